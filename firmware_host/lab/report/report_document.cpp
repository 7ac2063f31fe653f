#include "firmware_host/lab/report/report_document.hpp"

#include <memory>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/report/run_plots.hpp"
#include "firmware_host/lab/report/scene.hpp"
#include "firmware_host/lab/report/table.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

/// Spans of equal health, from the summary or else from the events.
Json healthJson(const RunView& view) {
  const RunFiles& files = view.files;
  Json spans = Json::array();
  const auto begin = [&](double t, const std::string& health, const Json& epoch) {
    if (!spans.empty()) spans.back()["to"] = t;
    spans.push_back({{"from", t}, {"to", t}, {"health", health}, {"epoch", epoch}});
  };
  const Json& history = files.at("health");
  if (history.is_array()) {
    for (const Json& change : history) {
      if (!change.is_object() || !change.contains("stamp_ns") || !change["stamp_ns"].is_number_integer())
        continue;
      const Json health = change.value("health", Json());
      begin(files.seconds(Stamp{change["stamp_ns"].get<std::int64_t>()}),
            health.is_string() ? health.get<std::string>() : "unknown", change.value("epoch", Json(nullptr)));
    }
  } else {
    for (const EventLine& event : files.events) {
      if (event.name == "health_changed") begin(files.seconds(event.stamp), event.text, nullptr);
    }
  }
  if (!spans.empty()) spans.back()["to"] = files.seconds(files.last_image);
  return spans;
}

Json eventsJson(const RunView& view) {
  Json events = Json::array();
  for (const EventLine& event : view.files.events) {
    events.push_back({{"t", view.files.seconds(event.stamp)}, {"name", event.name}, {"text", event.text}});
  }
  return events;
}

std::unique_ptr<MeshDistance> trueSurface(const ReportedRun& run, std::vector<MissingFile>& missing) {
  if (run.true_surface.empty() || (!run.view.files.map_mesh && !run.view.files.local_mesh)) return nullptr;
  try {
    const TriangleMesh mesh = readPly(run.true_surface);
    return mesh.faces.empty() ? nullptr : std::make_unique<MeshDistance>(mesh);
  } catch (const InputError& error) {
    missing.push_back({run.true_surface, error.what()});
    return nullptr;
  }
}

bool lacksHistograms(const RunView& view, const Json& plots) {
  if (!view.files.at("timing").is_object()) return false;
  for (const Json& plot : plots) {
    if (plot["kind"] == "histogram") return false;
  }
  return true;
}

}  // namespace

Json runDocument(const ReportedRun& run) {
  const RunView& view = run.view;
  std::vector<MissingFile> missing = view.files.missing;
  Json plots = Json::array();
  for (const Plot& plot : plotsOf(view)) plots.push_back(toJson(plot));
  if (lacksHistograms(view, plots)) {
    missing.push_back({"summary.json", "has no histograms in \"timing\": it is of an earlier program"});
  }
  Json tables = Json::array();
  for (const Table& table : tablesOf(view)) tables.push_back(toJson(table));
  const auto surface = trueSurface(run, missing);
  Json scene = sceneOf(view, surface.get());
  scene["labels"] = labelsJson(run.labels);
  Json faults = Json::array();
  for (const MissingFile& one : missing) faults.push_back({{"file", one.file}, {"what", one.what}});
  Json document = {{"name", view.files.name},
                   {"first_image_ns", std::to_string(view.files.first_image.ns)},
                   {"duration", view.files.seconds(view.files.last_image)},
                   {"missing", faults},
                   {"health", healthJson(view)},
                   {"events", eventsJson(view)},
                   {"plots", plots},
                   {"tables", tables},
                   {"scene", scene}};
  if (run.moments.is_object()) document.update(run.moments);
  return document;
}

Json reportDocument(const std::vector<ReportedRun>& runs) {
  Json json = {{"format", kReportFormat}, {"program", versionText()}, {"runs", Json::array()}};
  for (const ReportedRun& run : runs) json["runs"].push_back(runDocument(run));
  if (runs.size() == 2) {
    json["differences"] = Json::array();
    for (const Table& table : differencesOf(runs[0].view, runs[1].view)) {
      json["differences"].push_back(toJson(table));
    }
  }
  return json;
}

}  // namespace swiftlet
