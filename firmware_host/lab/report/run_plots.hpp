#pragma once
// The plots of a run, section by section. A plot without data is left out.

#include "firmware_host/lab/report/plot.hpp"
#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

/// Bands that are drawn around an estimate, and limits that it is judged by.
inline constexpr double kSigmas = 3;

/// From above and from the side: where the run has truth coloured by the distance from it, else by 3 sigma of
/// the position at the nearest keyframe.
std::vector<Plot> trajectoryPlots(const RunView& view);
/// Distance and attitude off the truth over time; of the keyframes each axis beside its 3 sigma.
std::vector<Plot> errorPlots(const RunView& view);
/// Velocity, biases, features, residuals: of the keyframes as they left the window.
std::vector<Plot> statePlots(const RunView& view);
/// Between neighbouring poses of odometry.tum and, where written, imu_rate.tum.
std::vector<Plot> intervalPlots(const RunView& view);
/// One for each stage and kind of time, frames and keyframes apart, beside the budgets of the settings.
std::vector<Plot> latencyPlots(const RunView& view);

/// All of the above.
std::vector<Plot> plotsOf(const RunView& view);

/// A budget of the run's settings for a stage: [ms] by "p50", "p99", "max"; what has none is left out.
/// `time`: "cpu" or "wall".
std::vector<std::pair<std::string, double>> budgetsOf(const RunView& view, const std::string& stage,
                                                      const std::string& time);

}  // namespace swiftlet
