#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "estimator/core/units.hpp"
#include "firmware_host/lab/report/run_plots.hpp"

namespace swiftlet {
namespace {

constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

using OfState = std::function<double(const StoredState&)>;

Series seriesOf(const RunView& view, const std::string& name, bool figures, const OfState& value) {
  Series series{name, SeriesStyle::kLine, {}, {}, {}};
  for (const StoredState& state : view.files.states) {
    if (figures && !state.has_figures) continue;
    series.x.push_back(view.files.seconds(state.stamp));
    series.y.push_back(value(state));
  }
  return series;
}

Plot figurePlot(const RunView& view, const char* id, const char* title, const char* unit,
                const std::vector<std::pair<const char*, OfState>>& lines) {
  Plot plot{id, "Features and residuals", title, PlotKind::kTime, "time [s]", unit, "", {}, {}, {}};
  for (const auto& [name, value] : lines) plot.series.push_back(seriesOf(view, name, true, value));
  return plot;
}

/// Three axes, with the truth's behind them if known.
Plot vectorPlot(const RunView& view, const char* id, const char* title, const char* unit,
                Eigen::Vector3d StoredState::*estimate, Eigen::Vector3d TrajectoryPoint::*truth) {
  Plot plot{id, "State", title, PlotKind::kTime, "time [s]", unit, "", {}, {}, {}};
  const bool known = view.hasTruth() && view.truth.front().has_motion;
  for (int axis = 0; axis < 3 && known; ++axis) {
    Series series{
        std::string("truth ") + kAxes[static_cast<std::size_t>(axis)], SeriesStyle::kTruth, {}, {}, {}};
    for (const TrajectoryPoint& point : view.truth) {
      series.x.push_back(view.files.seconds(point.stamp));
      series.y.push_back((point.*truth)[axis]);
    }
    plot.series.push_back(series);
  }
  for (int axis = 0; axis < 3; ++axis) {
    plot.series.push_back(seriesOf(view, kAxes[static_cast<std::size_t>(axis)], false,
                                   [=](const StoredState& state) { return (state.*estimate)[axis]; }));
  }
  return plot;
}

/// 3 sigma of the axis with the largest variance in a block of the state.
Plot sigmaPlot(const RunView& view, const char* id, const char* title, const char* unit, int block,
               double scale) {
  Plot plot{id, "State", title, PlotKind::kTime, "time [s]", unit, "", {}, {}, {}};
  for (int axis = 0; axis < 3; ++axis) {
    plot.series.push_back(
        seriesOf(view, kAxes[static_cast<std::size_t>(axis)], false, [=](const StoredState& state) {
          return kSigmas * scale * std::sqrt(std::max(0.0, state.variances[3 * block + axis]));
        }));
  }
  return plot;
}

}  // namespace

std::vector<Plot> statePlots(const RunView& view) {
  if (view.files.states.empty()) return {};
  std::vector<Plot> plots = {
      vectorPlot(view, "velocity", "Velocity", "m/s", &StoredState::v_world_body,
                 &TrajectoryPoint::v_world_body),
      vectorPlot(view, "bias_gyro", "Gyro bias", "rad/s", &StoredState::bias_gyro,
                 &TrajectoryPoint::bias_gyro),
      vectorPlot(view, "bias_accel", "Accelerometer bias", "m/s^2", &StoredState::bias_accel,
                 &TrajectoryPoint::bias_accel),
      sigmaPlot(view, "sigma_position", "3 sigma of position", "m", 1, 1),
      sigmaPlot(view, "sigma_attitude", "3 sigma of attitude", "deg", 0, kToDegrees),
      sigmaPlot(view, "sigma_velocity", "3 sigma of velocity", "m/s", 2, 1),
      figurePlot(view, "features", "Features and inliers", "count",
                 {{"tracks", [](const StoredState& s) { return s.figures.tracks; }},
                  {"inliers, one camera", [](const StoredState& s) { return s.figures.inliers_mono; }},
                  {"inliers, both cameras", [](const StoredState& s) { return s.figures.inliers_stereo; }},
                  {"landmarks in the window", [](const StoredState& s) { return s.figures.landmarks; }}}),
      figurePlot(view, "track_length", "Mean track length", "frames",
                 {{"frames", [](const StoredState& s) { return s.figures.track_length; }}}),
      figurePlot(view, "reprojection", "Reprojection RMS of the window", "px",
                 {{"px", [](const StoredState& s) { return s.figures.reprojection_rms; }}}),
      figurePlot(view, "imu_residual", "Normalized IMU residual (1 = as the noise model says)", "",
                 {{"residual", [](const StoredState& s) { return s.figures.imu_residual; }}}),
      figurePlot(view, "iterations", "Iterations of the smoother", "count",
                 {{"iterations", [](const StoredState& s) { return s.figures.iterations; }}}),
  };
  return plots;
}

}  // namespace swiftlet
