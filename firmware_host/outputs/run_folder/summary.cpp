#include "firmware_host/outputs/run_folder/summary.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>

#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/units.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/settings/registry.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

Json settingsJson(const Settings& settings) {
  Settings copy = settings;
  Json json;
  for (const Setting& setting : settingsRegistry()) {
    const std::string key(setting.key);
    std::visit([&](const auto& kind) { json[key] = kind.value(copy); }, setting.kind);
    const auto* real_or_word = std::get_if<RealOrWordSetting>(&setting.kind);
    if (real_or_word != nullptr && real_or_word->chosen(copy)) json[key] = real_or_word->word;
  }
  return json;
}

Json stampJson(const std::optional<Stamp>& stamp) { return stamp ? Json(stamp->ns) : Json(nullptr); }

double sinceFirstImage(const RunStatistics& statistics, Stamp stamp) {
  return statistics.first_image ? (stamp - *statistics.first_image).seconds() : 0;
}

Json toJson(const LocatedStatistics& located, const RunStatistics& run) {
  return {{"nodes", located.nodes},
          {"first_located_s", located.first ? Json(sinceFirstImage(run, *located.first)) : Json(nullptr)},
          {"located_at_end", located.now},
          {"keyframes_located", located.keyframes},
          {"taken_back", located.taken_back},
          {"verified", run.loop ? run.loop->kept_loops : 0}};
}

Json healthJson(const RunStatistics& statistics) {
  Json history = Json::array();
  for (const HealthChange& change : statistics.health) {
    history.push_back({{"stamp_ns", change.stamp.ns},
                       {"t_s", sinceFirstImage(statistics, change.stamp)},
                       {"health", healthName(change.health)},
                       {"epoch", change.epoch}});
  }
  return history;
}

Json countersJson(const RunFacts& facts, const RunStatistics& statistics) {
  Json json = facts.input;
  if (!facts.tracks.empty()) json["tracks"] = {{"surplus", facts.track_surplus}};
  json["pairing"] = {{"images", statistics.images},
                     {"pairs", statistics.pairing.pairs},
                     {"unpaired", statistics.pairing.unpaired},
                     {"refused", statistics.pairing.refused}};
  json["odometry"] = {
      {"imu_samples", statistics.imu_samples},
      {"imu_refused", statistics.imu_refused},
      {"frames", statistics.frames},
      {"frames_refused", statistics.frames_refused},
      {"frames_dropped", statistics.frames_dropped},
      {"effort_changes", statistics.effort_changes},
      {"smooth_faults", statistics.smooth_faults},
      {"keyframes", statistics.keyframes},
      {"poses", statistics.poses},
      {"frames_without_pose_after_first", statistics.frames_since_first_pose - statistics.poses}};
  json["events"] = Json::object();
  for (const auto& [kind, total] : statistics.events) {
    json["events"][std::string(eventName(kind))] = {{"count", total.count}, {"value_sum", total.value}};
  }
  if (statistics.map) {
    json["full_smoothing"] = toJson(*statistics.map);
  }
  if (statistics.mesh) {
    json["mesh"] = toJson(statistics.mesh->stage, statistics.mesh->horizon);
    json["mesh"]["skipped"] = statistics.mesh->skipped;
    json["mesh"]["without_image"] = statistics.mesh->without_image;
  }
  if (statistics.loop) json["loop"] = toJson(*statistics.loop);
  if (statistics.located) json["in_map"] = toJson(*statistics.located, statistics);
  json["losses"] = Json::object();
  for (const auto& [arrow, count] : statistics.losses) json["losses"][arrow] = count;
  json["faults"] = Json::object();
  for (const auto& [text, count] : statistics.faults) json["faults"][text] = count;
  return json;
}

/// The histogram as one line instead of one line per number: "from_ms count" of each non-empty column.
std::string histogramText(const LatencyHistogram& histogram) {
  constexpr double kFirstEdge = 1e-6;  // s; shorter durations count in the first column
  constexpr int kDecades = 8;
  std::string text;
  std::uint64_t below = 0;
  for (int i = 0; i < kDecades * kHistogramColumnsPerDecade && below < histogram.count(); ++i) {
    const double from = kFirstEdge * std::pow(10.0, static_cast<double>(i) / kHistogramColumnsPerDecade);
    const double to = kFirstEdge * std::pow(10.0, static_cast<double>(i + 1) / kHistogramColumnsPerDecade);
    const std::uint64_t up_to = histogram.countUpTo(to);
    if (up_to > below) {
      text += fmt::format("{}{:.4g} {}", text.empty() ? "" : ", ", from * kToMs, up_to - below);
    }
    below = up_to;
  }
  return text;
}

Json distributionJson(const LatencyHistogram& histogram) {
  constexpr double kMedian = 0.5;
  constexpr double kP90 = 0.9;
  constexpr double kP99 = 0.99;
  return {{"mean_ms", histogram.mean() * kToMs},
          {"p50_ms", histogram.percentile(kMedian) * kToMs},
          {"p90_ms", histogram.percentile(kP90) * kToMs},
          {"p99_ms", histogram.percentile(kP99) * kToMs},
          {"max_ms", histogram.max() * kToMs},
          {"total_s", histogram.total()},
          {"histogram", histogramText(histogram)}};
}

Json latencyJson(const LatencyHistogram& wall, const LatencyHistogram& cpu) {
  return {{"count", wall.count()}, {"wall", distributionJson(wall)}, {"cpu", distributionJson(cpu)}};
}

Json runJson(const RunFacts& facts, const RunStatistics& statistics) {
  Json json;
  if (!facts.log.empty()) json["log"] = facts.log;
  if (!facts.tracks.empty()) json["tracks"] = facts.tracks;
  json["cameras"] = facts.mono ? 1 : 2;
  json["finished"] = facts.finished;
  json["first_image_ns"] = stampJson(statistics.first_image);
  json["last_image_ns"] = stampJson(statistics.last_image);
  json["first_pose_ns"] = stampJson(statistics.first_pose);
  json["time_to_first_pose_s"] =
      statistics.first_pose ? Json(sinceFirstImage(statistics, *statistics.first_pose)) : Json(nullptr);
  const double frames = static_cast<double>(statistics.frames);
  json["tracking_coverage"] = statistics.frames == 0 ? 0.0 : static_cast<double>(statistics.poses) / frames;
  return json;
}

}  // namespace

Json timingJson(const StageTable& table) {
  Json json;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const StageTimes& times = table[i];
    if (times.wall_frames.count() + times.wall_keyframes.count() == 0) continue;
    Json stage;
    const auto id = static_cast<StageId>(i);
    const bool splits = id == StageId::kTrack || id == StageId::kSmooth || id == StageId::kTrim ||
                        id == StageId::kMesh || id == StageId::kImageToPose || id == StageId::kExposureToPose;
    stage[splits ? "frames" : "all"] = latencyJson(times.wall_frames, times.cpu_frames);
    if (splits) stage["keyframes"] = latencyJson(times.wall_keyframes, times.cpu_keyframes);
    json[std::string(stageName(id))] = stage;
  }
  return json;
}

Json toJson(const FullSmootherReport& map) {
  return {{"keyframes", map.keyframes},         {"landmarks", map.landmarks},
          {"iterations", map.iterations},       {"revisits", map.revisits},
          {"revisits_used", map.revisits_used}, {"matches", map.matches},
          {"matches_used", map.matches_used},   {"initial_cost", map.initial_cost},
          {"final_cost", map.final_cost}};
}

Json versionJson() {
  Json json;
  json["swiftlet"] = SWIFTLET_VERSION;
  json["compiler"] = __VERSION__;
  json["build_type"] = SWIFTLET_BUILD_TYPE;
  json["cpu"] = SWIFTLET_BUILD_CPU;
  json["eigen"] = fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION);
  return json;
}

std::string versionText() {
  return fmt::format("swiftlet {} ({}, {}, g++ {})", SWIFTLET_VERSION, SWIFTLET_BUILD_TYPE,
                     SWIFTLET_BUILD_CPU, __VERSION__);
}

Duration cameraToImuShift(const Json& summary) {
  const Json::json_pointer pointer("/run/t_imu_minus_t_image_ns");
  if (!summary.contains(pointer) || !summary.at(pointer).is_number_integer()) return {};
  return Duration{summary.at(pointer).get<std::int64_t>()};
}

Json toJson(const LogCounters& log) {
  return {{"imu_samples", log.imu_samples},
          {"images", log.images},
          {"bad_rows", log.bad_rows},
          {"nan_rows", log.nan_rows},
          {"out_of_order", log.out_of_order},
          {"repeated_stamps", log.repeated_stamps},
          {"missing_images", log.missing_images},
          {"damaged_images", log.damaged_images}};
}

Json toJson(const MeshCounters& stage, const HorizonCounters& horizon) {
  return {{"frames", stage.frames},
          {"invalid_frames", stage.invalid_frames},
          {"pose_jumps", stage.pose_jumps},
          {"too_few_points", stage.too_few_points},
          {"bad_landmarks", stage.bad_landmarks},
          {"bad_features", stage.bad_features},
          {"epochs", stage.epochs},
          {"refused_for_room", horizon.refused},
          {"faces_refuted", horizon.refuted},
          {"faces_replaced", horizon.replaced}};
}

Json toJson(const LoopCounters& loops) {
  Json fates = Json::object();
  for (std::size_t i = 0; i < loops.fates.size(); ++i) {
    if (loops.fates[i] > 0) fates[describe(static_cast<LoopFate>(i))] = loops.fates[i];
  }
  return {{"keyframes", loops.keyframes},
          {"nodes", loops.nodes},
          {"without_image", loops.without_image},
          {"bridged", loops.gaps},
          {"components", loops.components},
          {"candidates", fates},
          {"near_candidates", loops.near},
          {"verified", loops.loops},
          {"verified_near", loops.near_loops},
          {"selected", loops.selected},
          {"optimizations", loops.map.graph.optimizations},
          {"graduated_solutions", loops.map.graph.graduated_solutions},
          {"reconsidered", loops.map.graph.reconsidered},
          {"taken_back", loops.map.graph.taken_back},
          {"nodes_removed", loops.map.nodes_removed},
          {"loops_carried", loops.map.loops_carried},
          {"loops_released", loops.map.loops_released},
          {"refused", loops.refused}};
}

Json summaryOf(const RunFacts& facts, const Settings& settings, const RunStatistics& statistics) {
  const double flown = statistics.first_image && statistics.last_image
                           ? (*statistics.last_image - *statistics.first_image).seconds()
                           : 0;
  Json json;
  json["version"] = versionJson();
  json["run"] = runJson(facts, statistics);
  json["calibration"] = facts.calibration_form;
  json["settings"] = settingsJson(settings);
  json["verdict"] = statistics.verdict.json();
  json["health"] = healthJson(statistics);
  json["counters"] = countersJson(facts, statistics);
  json["warnings"] = facts.warnings;
  json["executor"] = facts.executor;
  json["timing"] = timingJson(statistics.times);
  json["cpu"] = {{"flight_s", flown},
                 {"wall_s", facts.wall},
                 {"cpu_s", facts.cpu},
                 {"real_time_factor", facts.wall > 0 ? flown / facts.wall : 0},
                 {"cpu_per_flight_second", flown > 0 ? facts.cpu / flown : 0}};
  Json table = Json::object();
  for (const MemoryRow& row : facts.memory) table[row.what] = row.bytes;
  json["memory"] = {{"peak_resident_bytes", facts.peak_resident}, {"table_bytes", table}};
  return json;
}

std::string summaryText(const Json& summary) {
  const Json& odometry = summary["counters"]["odometry"];
  std::string text =
      fmt::format("{} frames, {} keyframes, {} poses", odometry["frames"].get<std::uint64_t>(),
                  odometry["keyframes"].get<std::uint64_t>(), odometry["poses"].get<std::uint64_t>());
  const Json& first = summary["run"]["time_to_first_pose_s"];
  text += first.is_null() ? std::string(", no pose\n")
                          : fmt::format(", the first {:.3f} s after the first image\n", first.get<double>());
  for (const Json& line : summary["verdict"]["in_words"]) text += line.get<std::string>() + "\n";
  const Json& cpu = summary["cpu"];
  text += fmt::format(
      "{:.1f} s of flight in {:.2f} s ({:.2f} s of CPU, {:.3f} per second of flight), peak "
      "memory {:.1f} MiB\n",
      cpu["flight_s"].get<double>(), cpu["wall_s"].get<double>(), cpu["cpu_s"].get<double>(),
      cpu["cpu_per_flight_second"].get<double>(),
      static_cast<double>(summary["memory"]["peak_resident_bytes"].get<std::int64_t>()) / kMebibyte);
  text += "  CPU [ms]                    count     mean      p50      p99      max\n";
  for (const auto& [stage, times] : summary["timing"].items()) {
    for (const auto& [kind, t] : times.items()) {
      if (t["count"].get<std::uint64_t>() == 0) continue;
      const Json& cpu_ms = t["cpu"];
      text += fmt::format("  {:<17}{:<9}{:>7}{:9.3f}{:9.3f}{:9.3f}{:9.3f}\n", stage, kind,
                          t["count"].get<std::uint64_t>(), cpu_ms["mean_ms"].get<double>(),
                          cpu_ms["p50_ms"].get<double>(), cpu_ms["p99_ms"].get<double>(),
                          cpu_ms["max_ms"].get<double>());
    }
  }
  return text;
}

void writeJson(const std::string& path, const Json& json) {
  // File names in messages may contain any bytes, so invalid UTF-8 is replaced.
  writeWholeFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace swiftlet
