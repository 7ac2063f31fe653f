#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/core/units.hpp"
#include "firmware_host/lab/report/run_plots.hpp"

namespace swiftlet {
namespace {

constexpr const char* kTime = "time [s]";

/// The value of the sample nearest in time; `t` must rise.
double nearest(const std::vector<double>& t, const std::vector<double>& values, double at) {
  const auto after = std::ranges::lower_bound(t, at);
  if (after == t.begin()) return values.front();
  if (after == t.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - t.begin());
  return t[i] - at < at - t[i - 1] ? values[i] : values[i - 1];
}

/// Quantity over time that shows where a trajectory went wrong.
struct Judge {
  std::string label;
  std::vector<double> t;
  std::vector<double> value;
};

Judge judgeOf(const RunView& view) {
  Judge judge;
  if (view.hasTruth()) {
    judge = {"error [m]", view.odometry_errors.t, view.odometry_errors.distance};
  } else if (!view.files.states.empty()) {
    judge.label = "3 sigma of position [m]";
    for (const StoredState& state : view.files.states) {
      judge.t.push_back(view.files.seconds(state.stamp));
      judge.value.push_back(kSigmas * std::sqrt(std::max(0.0, state.variances.segment<3>(3).sum())));
    }
  }
  return judge;
}

Series along(const Trajectory& poses, int across, int up, const std::string& name, SeriesStyle style) {
  Series series{name, style, {}, {}, {}};
  for (const TrajectoryPoint& point : poses) {
    series.x.push_back(point.T_world_body.translation[across]);
    series.y.push_back(point.T_world_body.translation[up]);
  }
  return series;
}

Plot plan(const RunView& view, const Judge& judge, const char* id, const char* title, int across, int up) {
  constexpr std::array<const char*, 3> kAxisTitles = {"x [m]", "y [m]", "z [m]"};
  Plot plot{id,
            "Trajectory",
            title,
            PlotKind::kPlan,
            kAxisTitles[static_cast<std::size_t>(across)],
            kAxisTitles[static_cast<std::size_t>(up)],
            judge.label,
            {},
            {},
            {}};
  if (view.hasTruth()) plot.series.push_back(along(view.truth, across, up, "truth", SeriesStyle::kTruth));
  if (!view.files.map.empty()) {
    plot.series.push_back(along(view.files.map, across, up, "map.tum", SeriesStyle::kPoints));
  }
  Series flown = along(view.files.odometry, across, up, "odometry", SeriesStyle::kLine);
  if (!judge.t.empty()) {
    for (const TrajectoryPoint& point : view.files.odometry) {
      flown.value.push_back(nearest(judge.t, judge.value, view.files.seconds(point.stamp)));
    }
  }
  plot.series.push_back(flown);
  if (!view.hasTruth()) plot.note = "There is no truth.";
  return plot;
}

/// The horizontal axis along which the flight is longer: the side view is perpendicular to it.
int longerAxis(const Trajectory& poses) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9);
  Eigen::Vector3d high = -low;
  for (const TrajectoryPoint& point : poses) {
    low = low.cwiseMin(point.T_world_body.translation);
    high = high.cwiseMax(point.T_world_body.translation);
  }
  return high.x() - low.x() >= high.y() - low.y() ? 0 : 1;
}

Plot overTime(const char* id, const char* group, const std::string& title, const char* unit) {
  return {id, group, title, PlotKind::kTime, kTime, unit, "", {}, {}, {}};
}

/// One axis of the keyframes' error and its 3 sigma. `index` in (phi, p).
Plot axisError(const RunView& view, int index) {
  constexpr std::array<const char*, 6> kIds = {"error_phi_x", "error_phi_y", "error_phi_z",
                                               "error_x",     "error_y",     "error_z"};
  constexpr std::array<const char*, 6> kTitles = {"Attitude, about body x",
                                                  "Attitude, about body y",
                                                  "Attitude, about body z",
                                                  "Position, x",
                                                  "Position, y",
                                                  "Position, z"};
  const bool angle = index < 3;
  const double scale = angle ? kToDegrees : 1;
  Plot plot = overTime(kIds[static_cast<std::size_t>(index)], "Error and 3 sigma of the keyframes",
                       kTitles[static_cast<std::size_t>(index)], angle ? "deg" : "m");
  Series band{"3 sigma", SeriesStyle::kBand, {}, {}, {}};
  Series error{"error", SeriesStyle::kLine, {}, {}, {}};
  for (std::size_t i = 0; i < view.keyframe_errors.size(); ++i) {
    const ConsistencyError& found = view.keyframe_errors[i];
    const double variance = found.covariance(index, index);
    if (!std::isfinite(variance) || variance < 0) continue;
    const double t = view.files.seconds(view.error_stamps[i]);
    error.x.push_back(t);
    error.y.push_back(found.error[index] * scale);
    band.x.push_back(t);
    band.y.push_back(kSigmas * std::sqrt(variance) * scale);
  }
  plot.series = {band, error};
  return plot;
}

}  // namespace

std::vector<Plot> trajectoryPlots(const RunView& view) {
  if (view.files.odometry.empty()) return {};
  const Judge judge = judgeOf(view);
  return {plan(view, judge, "from_above", "From above", 0, 1),
          plan(view, judge, "from_the_side", "From the side", longerAxis(view.files.odometry), 2)};
}

std::vector<Plot> errorPlots(const RunView& view) {
  if (!view.hasTruth()) return {};
  Plot position = overTime("error_position", "Error", "Distance from the truth, yaw alignment", "m");
  Plot attitude = overTime("error_attitude", "Error", "Attitude off the truth", "deg");
  const auto add = [&](const char* name, SeriesStyle style, const PoseErrors& errors) {
    if (errors.t.empty()) return;
    position.series.push_back({name, style, errors.t, errors.distance, {}});
    attitude.series.push_back({name, style, errors.t, errors.degrees, {}});
  };
  add("odometry", SeriesStyle::kLine, view.odometry_errors);
  add("map.tum", SeriesStyle::kPoints, view.map_errors);
  std::vector<Plot> plots = {position, attitude};
  for (const int index : {3, 4, 5, 0, 1, 2}) plots.push_back(axisError(view, index));
  return plots;
}

std::vector<Plot> intervalPlots(const RunView& view) {
  std::vector<Plot> plots;
  const auto add = [&](const char* id, const char* title, const Trajectory& poses, const char* note) {
    Plot plot = overTime(id, "Stamps", title, "ms");
    plot.note = note;
    Series series{"interval", SeriesStyle::kLine, {}, {}, {}};
    for (std::size_t i = 1; i < poses.size(); ++i) {
      series.x.push_back(view.files.seconds(poses[i].stamp));
      series.y.push_back((poses[i].stamp - poses[i - 1].stamp).seconds() * kToMs);
    }
    plot.series.push_back(series);
    plots.push_back(plot);
  };
  add("interval_images", "Between images with a pose", view.files.odometry, "");
  if (!view.files.imu_rate.empty()) {
    add("interval_imu", "Between states at IMU rate", view.files.imu_rate, "");
  }
  return plots;
}

}  // namespace swiftlet
