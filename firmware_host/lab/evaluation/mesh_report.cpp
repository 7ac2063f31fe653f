#include "firmware_host/lab/evaluation/mesh_report.hpp"

#include <fmt/format.h>

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

double observedShare(const CompleteMeshAccuracy& complete) {
  return static_cast<double>(complete.covered) / static_cast<double>(complete.observed);
}

Json distanceJson(const DistanceStatistics& s) {
  return {{"mean", s.mean},
          {"rmse", s.rmse},
          {"median", s.median},
          {"percentile_95", s.percentile95},
          {"samples", s.count}};
}

Json sequenceJson(const MeshSequenceAccuracy& sequence) {
  return {{"meshes", sequence.meshes},
          {"empty", sequence.empty},
          {"area_m2", sequence.area},
          {"samples_per_m2", sequence.density},
          {"distance_m", distanceJson(sequence.distance)},
          {"median_rmse_m", sequence.median_rmse},
          {"completeness", sequence.completeness.share()},
          {"completeness_by_area", sequence.completeness.areaShare()},
          {"median_completeness", sequence.median_completeness},
          {"seen_points", sequence.completeness.seen},
          {"drawn_share", sequence.completeness.drawnShare()},
          {"relative_rmse", sequence.completeness.relativeRmse()},
          {"median_hull_share", sequence.median_hull_share},
          {"label_share", sequence.label_share},
          {"unlabelled_share", sequence.unlabelled_share}};
}

Json labelsJson(const LabelConfusion& labels) {
  Json json = {{"accuracy", labels.accuracy()},
               {"mean_iou", labels.meanIntersectionOverUnion(kLeastClassShare)},
               {"least_class_share", kLeastClassShare}};
  for (const std::uint8_t label : labels.classes()) {
    json["classes"][std::to_string(label)] = {
        {"share", static_cast<double>(labels.places(label)) / static_cast<double>(labels.places())},
        {"iou", labels.intersectionOverUnion(label)}};
  }
  return json;
}

Json completeJson(const CompleteMeshAccuracy& complete) {
  Json json = {{"file", complete.file},
               {"vertices", complete.vertices},
               {"faces", complete.faces},
               {"area_m2", complete.area},
               {"samples_per_m2", complete.density},
               {"distance_m", distanceJson(complete.distance)},
               {"label_share", complete.label_share},
               {"unlabelled_share", complete.unlabelled_share},
               {"observed_points", complete.observed}};
  if (complete.observed > 0) json["completeness"] = observedShare(complete);
  if (complete.unlabelled_share < 1) json["labels"] = labelsJson(complete.labels);
  if (complete.registration) {
    json["after_registration"] = {{"distance_m", distanceJson(complete.registered)},
                                  {"settled", complete.registration->settled},
                                  {"moved_m", complete.registration->motion.T_to_from.translation.norm()}};
  }
  return json;
}

std::string distanceText(const DistanceStatistics& s) {
  if (s.count == 0) return fmt::format("{:>9}{:>9}{:>9}{:>9}", "-", "-", "-", "-");
  return fmt::format("{:9.4f}{:9.4f}{:9.4f}{:9.4f}", s.mean, s.rmse, s.median, s.percentile95);
}

/// "-" if no face has a label.
std::string labelText(double right, double unlabelled, std::size_t samples) {
  const bool labelled = samples > 0 && unlabelled < 1;
  return fmt::format("{:>8}{:>12}", labelled ? fmt::format("{:.1f} %", 100 * right) : "-",
                     samples > 0 ? fmt::format("{:.1f} %", 100 * unlabelled) : "-");
}

std::string sequenceText(const char* name, const MeshSequenceAccuracy& sequence) {
  const DistanceStatistics& distance = sequence.distance;
  return fmt::format("  {:<10}{:6}{}{:9.1f} %{:8.1f} %{:8.1f} %{:8.1f} %{:8.1f} %{:8.2f} %{}\n", name,
                     sequence.meshes, distanceText(distance), 100 * sequence.completeness.share(),
                     100 * sequence.median_completeness, 100 * sequence.completeness.areaShare(),
                     100 * sequence.median_hull_share, 100 * sequence.completeness.drawnShare(),
                     100 * sequence.completeness.relativeRmse(),
                     labelText(sequence.label_share, sequence.unlabelled_share, distance.count)) +
         (sequence.empty > 0 ? fmt::format("  {:<10}{:6} of them without area\n", "", sequence.empty) : "");
}

std::string completeText(const CompleteMeshAccuracy& complete) {
  std::string text = fmt::format(
      "  {}: {} points, {} triangles, {:.1f} m^2; distance [m] mean {:.4f}  rmse {:.4f}  median {:.4f}  95 % "
      "{:.4f}",
      complete.file, complete.vertices, complete.faces, complete.area, complete.distance.mean,
      complete.distance.rmse, complete.distance.median, complete.distance.percentile95);
  if (complete.observed > 0) {
    text += fmt::format("; {:.1f} % of {} seen points within {:g} m", 100 * observedShare(complete),
                        complete.observed, kCovered);
  }
  if (complete.distance.count > 0 && complete.unlabelled_share < 1) {
    text += fmt::format("; labels correct {:.1f} % of the labelled", 100 * complete.label_share);
  }
  if (complete.registration) {
    text += fmt::format(
        "\n"
        "    aligned with the truth: rmse {:.4f}  median {:.4f}",
        complete.registered.rmse, complete.registered.median);
  }
  if (complete.labels.places() > 0 && complete.unlabelled_share < 1) {
    text += fmt::format(
        "\n    labels: accuracy {:.1f} %, mean IoU {:.1f} % over classes with {:g} % and more",
        100 * complete.labels.accuracy(), 100 * complete.labels.meanIntersectionOverUnion(kLeastClassShare),
        100 * kLeastClassShare);
  }
  return text + "\n";
}

}  // namespace

Json toJson(const MeshAccuracy& accuracy) {
  Json json = {{"truth", accuracy.truth},
               {"align", accuracy.alignment},
               {"frames", accuracy.frames},
               {"frames_without_truth", accuracy.without_truth},
               {"keyframes_without_mesh", accuracy.keyframes_bare},
               {"covered_within_m", kCovered},
               {"grid_step_px", kGridStep}};
  if (accuracy.frame) json["frame"] = sequenceJson(*accuracy.frame);
  if (accuracy.horizon) json["horizon"] = sequenceJson(*accuracy.horizon);
  if (accuracy.map) json["map"] = completeJson(*accuracy.map);
  if (accuracy.complete) json["complete"] = completeJson(*accuracy.complete);
  return json;
}

std::string toText(const MeshAccuracy& accuracy) {
  std::string text =
      fmt::format("meshes against {}, moved by {}\n",
                  accuracy.truth.empty() ? "no true surface: only coverage is evaluated" : accuracy.truth,
                  accuracy.alignment);
  if (accuracy.frame || accuracy.horizon) {
    text += fmt::format("  {} frames", accuracy.frames);
    if (accuracy.without_truth > 0) text += fmt::format(", {} omitted without truth", accuracy.without_truth);
    if (accuracy.keyframes_bare > 0)
      text += fmt::format(", {} keyframes without mesh", accuracy.keyframes_bare);
    text += fmt::format(
        "; distance [m]; complete: seen points of all frames with mesh within {:g} m, median of frames, by "
        "area; hull: of the image; drawn: of the hull; relative: RMSE of what is drawn over its distance "
        "from the camera\n"
        "  {:<10}{:>6}{:>9}{:>9}{:>9}{:>9}{:>11}{:>10}{:>10}{:>10}{:>10}{:>10}{:>8}{:>12}\n",
        kCovered, "mesh", "count", "mean", "RMSE", "median", "95 %", "complete", "median", "by area", "hull",
        "drawn", "relative", "labels", "unlabelled");
  }
  if (accuracy.frame) text += sequenceText("frame", *accuracy.frame);
  if (accuracy.horizon) text += sequenceText("horizon", *accuracy.horizon);
  if (accuracy.map) text += completeText(*accuracy.map);
  if (accuracy.complete) text += completeText(*accuracy.complete);
  return text;
}

}  // namespace swiftlet
