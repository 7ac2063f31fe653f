#include "firmware_host/lab/evaluation/accuracy_report.hpp"

#include <fmt/format.h>

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

Json statisticsJson(const ErrorStatistics& s) {
  if (s.count == 0) {
    Json none = {{"count", 0}};
    for (const char* figure : {"rmse", "mean", "median", "std", "min", "max", "sse"}) none[figure] = nullptr;
    return none;
  }
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.deviation},
          {"min", s.min},   {"max", s.max},   {"sse", s.sse},       {"count", s.count}};
}

std::string absoluteText(const TrajectoryError& absolute) {
  std::string text = fmt::format(
      "  ATE ({} alignment)  rmse {:.4f} m  mean {:.4f}  median {:.4f}  max {:.4f}  per axis {:.4f} {:.4f} "
      "{:.4f}\n",
      alignName(absolute.kind), absolute.translation.rmse, absolute.translation.mean,
      absolute.translation.median, absolute.translation.max, absolute.axis_rmse.x(), absolute.axis_rmse.y(),
      absolute.axis_rmse.z());
  if (!absolute.status.ok()) text += fmt::format("  note: {}\n", absolute.status.what);
  if (absolute.kind == AlignKind::kSim3) text += fmt::format("  scale {:.5f}\n", absolute.alignment.scale);
  return text;
}

}  // namespace

Json toJson(const Accuracy& accuracy) {
  const TrajectoryError& absolute = accuracy.absolute;
  Json json;
  json["align"] = alignName(absolute.kind);
  json["max_truth_gap_ms"] = accuracy.max_gap.seconds() * 1e3;
  json["poses"] = accuracy.estimates;
  json["pairs"] = accuracy.pairs;
  json["coverage"] = accuracy.coverage();
  json["duration_s"] = accuracy.duration;
  json["path_m"] = absolute.path_length;
  if (!absolute.status.ok()) json["note"] = absolute.status.what;
  if (absolute.translation.count == 0) return json;
  json["ate_m"] = statisticsJson(absolute.translation);
  json["ate_axis_rmse_m"] = {absolute.axis_rmse.x(), absolute.axis_rmse.y(), absolute.axis_rmse.z()};
  json["rotation_deg"] = statisticsJson(absolute.rotation);
  json["attitude_deg"] = statisticsJson(absolute.attitude);
  json["tilt_deg"] = statisticsJson(absolute.tilt);
  json["scale"] = absolute.alignment.scale;
  json["rpe_time"] = {{"interval_s", accuracy.over_time.interval},
                      {"translation_m", statisticsJson(accuracy.over_time.translation)},
                      {"rotation_deg", statisticsJson(accuracy.over_time.rotation)}};
  json["rpe_distance"] = Json::array();
  for (const RelativeError& error : accuracy.over_distance) {
    json["rpe_distance"].push_back({{"length_m", error.interval},
                                    {"translation_percent", statisticsJson(error.translation)},
                                    {"rotation_deg_per_m", statisticsJson(error.rotation)}});
  }
  return json;
}

Json toJson(const Consistency& consistency) {
  const auto figure = [&](double value) { return consistency.count > 0 ? Json(value) : Json(nullptr); };
  return {{"states", consistency.count},
          {"without_covariance", consistency.without_covariance},
          {"nees_pose_6dof", figure(consistency.nees_pose)},
          {"nees_rotation_3dof", figure(consistency.nees_rotation)},
          {"nees_position_3dof", figure(consistency.nees_position)},
          {"inside_3_sigma", figure(consistency.inside_3_sigma)}};
}

Json toJson(const CommonStamps& map_beside_odometry) {
  const auto figure = [&](double value) {
    return map_beside_odometry.pairs < kFewestPairs ? Json(nullptr) : Json(value);
  };
  return {{"pairs", map_beside_odometry.pairs},
          {"odometry_ate_rmse_m", figure(map_beside_odometry.reference_rmse)},
          {"map_ate_rmse_m", figure(map_beside_odometry.other_rmse)},
          {"ratio", figure(map_beside_odometry.ratio())}};
}

Json toJson(const Revisits& revisits) {
  return {{"samples", revisits.samples}, {"revisiting", revisits.revisiting}, {"pairs", revisits.pairs}};
}

std::string toText(const CommonStamps& map_beside_odometry) {
  if (map_beside_odometry.pairs < kFewestPairs) return "  fewer than 3 pairs leave no error to measure\n";
  return fmt::format("  ATE rmse of odometry.tum {:.4f} m, of map.tum {:.4f} m: {:.2f} times  ({} poses)\n",
                     map_beside_odometry.reference_rmse, map_beside_odometry.other_rmse,
                     map_beside_odometry.ratio(), map_beside_odometry.pairs);
}

Json toJson(const LoopAccuracy& loops) {
  const auto figure = [&](double value) { return loops.verified_right > 0 ? Json(value) : Json(nullptr); };
  return {{"verified", loops.verified},
          {"verified_right", loops.verified_right},
          {"selected", loops.selected},
          {"selected_right", loops.selected_right},
          {"without_truth", loops.without_truth},
          {"median_error_m", figure(loops.median_distance)},
          {"median_error_deg", figure(loops.median_degrees)}};
}

std::string toText(const LoopAccuracy& loops) {
  std::string text = fmt::format(
      "  {} of {} verified are correct (within {:g} m and {:g} deg), {} of {} selected", loops.verified_right,
      loops.verified, kFalseLoopDistance, kFalseLoopDegrees, loops.selected_right, loops.selected);
  if (loops.verified_right > 0) {
    text += fmt::format("; median error {:.4f} m, {:.3f} deg", loops.median_distance, loops.median_degrees);
  }
  return text + "\n";
}

std::string toText(const Revisits& revisits) {
  return fmt::format(
      "  {} of {} places (one every 0.5 s) are within 1 m and 30 degrees of one visited more than 20 s "
      "earlier\n",
      revisits.revisiting, revisits.samples);
}

std::string toText(const std::string& title, const Accuracy& accuracy) {
  const TrajectoryError& absolute = accuracy.absolute;
  std::string text = fmt::format("{}: {} of {} poses have truth (gap at most {:g} ms)", title, accuracy.pairs,
                                 accuracy.estimates, accuracy.max_gap.seconds() * 1e3);
  if (accuracy.pairs == 0) return text + ": nothing to compare\n";
  if (accuracy.pairs < kFewestPairs) return text + ": fewer than 3 pairs leave no error to measure\n";
  text += fmt::format(", {:.1f} s, {:.1f} m\n", accuracy.duration, absolute.path_length);
  text += absoluteText(absolute);
  text +=
      fmt::format("  rotation  rmse {:.3f} deg  max {:.3f}; tilt, unaligned  rmse {:.3f} deg  max {:.3f}\n",
                  absolute.rotation.rmse, absolute.rotation.max, absolute.tilt.rmse, absolute.tilt.max);
  if (accuracy.over_time.translation.count > 0) {
    text += fmt::format("  RPE over {:g} s  rmse {:.4f} m  {:.3f} deg  ({} intervals)\n",
                        accuracy.over_time.interval, accuracy.over_time.translation.rmse,
                        accuracy.over_time.rotation.rmse, accuracy.over_time.translation.count);
  }
  for (const RelativeError& error : accuracy.over_distance) {
    text += fmt::format("  RPE over {:g} m  mean {:.3f} %  {:.4f} deg/m  ({} segments)\n", error.interval,
                        error.translation.mean, error.rotation.mean, error.translation.count);
  }
  return text;
}

Json toJson(const PositionAccuracy& accuracy) {
  const TrajectoryError& absolute = accuracy.absolute;
  Json json;
  json["align"] = alignName(absolute.kind);
  json["positions"] = accuracy.positions;
  json["pairs"] = accuracy.pairs;
  json["shift_s"] = accuracy.shift.seconds();
  json["duration_s"] = accuracy.duration;
  json["path_m"] = absolute.path_length;
  if (!absolute.status.ok()) json["note"] = absolute.status.what;
  if (absolute.translation.count == 0) return json;
  json["ate_m"] = statisticsJson(absolute.translation);
  json["ate_axis_rmse_m"] = {absolute.axis_rmse.x(), absolute.axis_rmse.y(), absolute.axis_rmse.z()};
  json["scale"] = absolute.alignment.scale;
  return json;
}

std::string toText(const std::string& title, const PositionAccuracy& accuracy) {
  std::string text =
      fmt::format("{}: {} of {} positions have an estimate", title, accuracy.pairs, accuracy.positions);
  if (accuracy.shift.ns != 0) text += fmt::format(", shifted by {:+.3f} s", accuracy.shift.seconds());
  if (accuracy.pairs == 0) return text + ": nothing to compare\n";
  if (accuracy.pairs < kFewestPairs) return text + ": fewer than 3 pairs leave no error to measure\n";
  text += fmt::format(", {:.1f} s, {:.1f} m\n", accuracy.duration, accuracy.absolute.path_length);
  return text + absoluteText(accuracy.absolute);
}

std::string toText(const Consistency& consistency) {
  if (consistency.count == 0) {
    return fmt::format("  NEES: none of {} keyframes has a usable covariance\n",
                       consistency.without_covariance);
  }
  return fmt::format(
      "  NEES  pose {:.2f} (6 if consistent and the truth is exact)  rotation {:.2f} (3)  "
      "position {:.2f} (3)  inside 3 sigma {:.1f} %  ({} keyframes)\n",
      consistency.nees_pose, consistency.nees_rotation, consistency.nees_position,
      100 * consistency.inside_3_sigma, consistency.count);
}

}  // namespace swiftlet
