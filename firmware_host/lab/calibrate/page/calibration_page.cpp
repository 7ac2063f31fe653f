#include "firmware_host/lab/calibrate/page/calibration_page.hpp"

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/report/plain_page.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

const char* kindOf(PageVerdict verdict) {
  switch (verdict) {
    case PageVerdict::kGood:
      return "good";
    case PageVerdict::kUsable:
      return "usable";
    case PageVerdict::kRepeat:
      break;
  }
  return "repeat";
}

std::string plainHtml(const CalibrationPage& page) {
  std::string html = "<p class=\"verdict\">" + htmlText(page.verdict_text) + "</p>\n";
  for (const std::string& line : page.words) html += "<p>" + htmlText(line) + "</p>\n";
  std::string group;
  for (const Plot& plot : page.plots) {
    if (plot.empty()) continue;
    if (plot.group != group) html += "<h3>" + htmlText(plot.group) + "</h3>\n";
    group = plot.group;
    html += svgPlot(plot) + "\n";
  }
  for (const Table& table : page.tables) html += tableHtml(table);
  return plainDocument("swiftlet: " + page.name, html);
}

}  // namespace

std::string calibrationHtml(const CalibrationPage& page, const std::string& program,
                            const std::string& program_name) {
  if (program.empty()) return plainHtml(page);
  Json run = {{"name", page.name},
              {"verdict", {{"kind", kindOf(page.verdict)}, {"text", page.verdict_text}}},
              {"words", page.words},
              {"plots", Json::array()},
              {"tables", Json::array()}};
  for (const Plot& plot : page.plots) {
    if (!plot.empty()) run["plots"].push_back(toJson(plot));
  }
  for (const Table& table : page.tables) run["tables"].push_back(toJson(table));
  if (!page.scene.is_null()) run["scene"] = page.scene;
  const Json document = {{"format", kReportFormat}, {"program", versionText()}, {"runs", {run}}};
  return pageWith(program, program_name, document);
}

void writeCalibrationPage(const std::string& path, const CalibrationPage& page) {
  const ReportProgram program = readReportProgram();
  writeWholeFile(path, calibrationHtml(page, program.text, program.name) + "\n");
}

}  // namespace swiftlet
