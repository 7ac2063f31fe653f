#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "firmware_host/lab/calibrate/page/board_evidence.hpp"
#include "firmware_host/lab/calibrate/page/page_rules.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

// With a correct noise model, normalized residuals are near 1. A factor of two means a wrong density,
// vibration or a bad fit, and changes the sigmas by as much.
constexpr double kMostImuSigma = 2;
constexpr double kLeastImuSigma = 0.5;
// Smaller sigmas do not affect a flight: docs/calibration.md.
constexpr double kRotationSigma = 0.05;  // deg
constexpr double kPositionSigma = 3;     // mm
constexpr double kTimeSigma = 0.1;       // ms

double largestSigma(const ImuCameraSolution& solution, const std::string& part, const std::string& unit) {
  double most = 0;
  for (const SolvedValue& value : solution.values) {
    if (value.unit == unit && value.name.find(part) != std::string::npos) most = std::max(most, value.sigma);
  }
  return most;
}

Plot residualPlot(const ImuCameraSolution& solution, bool gyro) {
  Plot plot;
  plot.id = gyro ? "gyro_residual" : "accel_residual";
  plot.group = "IMU residuals";
  plot.title = gyro ? "Gyro minus spline" : "Accelerometer minus spline";
  plot.x_label = "s";
  plot.y_label = gyro ? "rad/s" : "m/s^2";
  constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    Series series;
    series.name = kAxes.at(static_cast<std::size_t>(axis));
    for (const ImuResidual& residual : solution.imu_residuals) {
      series.x.push_back((residual.stamp - solution.imu_residuals.front().stamp).seconds());
      series.y.push_back(gyro ? residual.gyro[axis] : residual.accel[axis]);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

}  // namespace

CalibrationPage imuCameraPage(const ImuCameraSolution& solution, const CalibrationTarget& target,
                              const std::string& log) {
  CalibrationPage page;
  page.name = "Cameras and IMU of " + log;
  BoardEvidence evidence;
  evidence.camera_count = solution.rig.camera_count;
  evidence.camera = solution.rig.camera;
  if (solution.rig.camera_count > 1) evidence.T_cam1_cam0 = solution.rig.T_cam1_cam0();
  evidence.corner_sigma = solution.corner_sigma;
  evidence.target = target;
  evidence.views = solution.views;
  evidence.corners = solution.corners;

  PageRules rules;
  if (evidence.camera_count == 0 || evidence.camera[0].width() == 0) {
    rules.finish({"No solution was found."}, page);
    page.words.insert(page.words.end(), solution.reasons.begin(), solution.reasons.end());
    return page;
  }
  for (const auto& [what, sigma] :
       {std::pair{"gyro", solution.gyro_sigma}, {"accelerometer", solution.accel_sigma}}) {
    rules.atMost(fmt::format("{} residual relative to its noise", what), "", sigma, kMostImuSigma,
                 fmt::format("The {} fits the motion worse than its noise density allows: vibration, a wrong "
                             "noise density, a loose mount or stamp jitter. Check its residuals over time.",
                             what));
    rules.atLeast(
        fmt::format("{} residual relative to its noise", what), "", sigma, kLeastImuSigma,
        fmt::format("The {} is quieter than its given noise density: the densities, and with them the sigmas "
                    "here, are too large. Measure them with `swiftlet calibrate imu-noise`.",
                    what));
  }
  rules.atMost(
      "corners rejected", "", outlierShare(evidence), kMostOutliers,
      "Many corners were rejected. Check the outliers: reflections, blur, a bent board or a wrong target.");
  rules.atMost("camera to IMU: rotation, 1 sigma", "deg", largestSigma(solution, "rotation", "deg"),
               kRotationSigma,
               "The rotation from the cameras to the IMU is not determined well enough. Rotate the rig "
               "faster about all axes.");
  rules.atMost("camera to IMU: position, 1 sigma", "mm", largestSigma(solution, "T_body_cam", "mm"),
               kPositionSigma,
               "The position of the cameras on the IMU is not determined well enough. Rotate the rig faster "
               "about all axes, near the board.");
  rules.atMost(
      "time offset, 1 sigma", "ms", largestSigma(solution, "", "ms"), kTimeSigma,
      "The time offset is not determined well enough. Move the rig with quick changes of direction.");
  Table values{"values", "Values", {"what", "value", "1 sigma", "unit"}, {}, false};
  for (const SolvedValue& value : solution.values) {
    values.rows.push_back(
        {value.name, fmt::format("{:.6g}", value.value), fmt::format("{:.2g}", value.sigma), value.unit});
  }
  page.tables.push_back(values);
  rules.finish(solution.reasons, page);
  page.plots.push_back(residualPlot(solution, true));
  page.plots.push_back(residualPlot(solution, false));
  for (Plot& plot : boardPlots(evidence)) page.plots.push_back(std::move(plot));
  for (Table& table : boardTables(evidence)) page.tables.push_back(std::move(table));
  page.scene = boardScene(evidence);
  return page;
}

}  // namespace swiftlet
