#pragma once
// The plots of a run, section by section. Plots without data are omitted.

#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

/// Width of the bands around an estimate and of the limits for judging it.
inline constexpr double kSigmas = 3;

/// View from above and from the side, coloured by the distance from the truth, or without truth by 3 sigma of
/// the position at the nearest keyframe.
std::vector<Plot> trajectoryPlots(const RunView& view);
/// Position and attitude errors over time; for keyframes each axis with its 3 sigma.
std::vector<Plot> errorPlots(const RunView& view);
/// Velocity, biases, features, residuals of the keyframes when they left the window.
std::vector<Plot> statePlots(const RunView& view);
/// Intervals between neighbouring poses of odometry.tum and, if written, imu_rate.tum.
std::vector<Plot> intervalPlots(const RunView& view);
/// One plot per stage and kind of time, frames and keyframes separately, with the budgets of the settings.
std::vector<Plot> latencyPlots(const RunView& view);

/// All of the above.
std::vector<Plot> plotsOf(const RunView& view);

/// Budgets of a stage in the run's settings [ms], by "p50", "p99", "max"; values without a budget are
/// omitted. `time`: "cpu" or "wall".
std::vector<std::pair<std::string, double>> budgetsOf(const RunView& view, const std::string& stage,
                                                      const std::string& time);

}  // namespace swiftlet
