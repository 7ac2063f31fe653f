#pragma once
// Verdict over a whole run: how long the estimate was good, and what to check first if it was not.
//
// Frames are added one by one; constant memory.

#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimator/messages/odometry_output.hpp"

namespace swiftlet {

class RunVerdict {
 public:
  /// Adds a frame's output; a frame without a state counts as initializing.
  void add(Stamp stamp, const OdometryOutput& output);

  /// Share of the run's time with good health, from the first image on; 1 for a run without frames.
  [[nodiscard]] double shareGood() const;
  /// The newest calibration, if any part of it is estimated; else null.
  [[nodiscard]] const CalibrationEstimate* estimatedCalibration() const;
  /// For summary.json: shares, doubts, sigmas, the estimated calibration if there is one, and `words`.
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  /// Human-readable lines.
  [[nodiscard]] std::vector<std::string> words() const;
  /// Mean of a sum over the time with a state; 0 without a state.
  [[nodiscard]] double mean(double sum) const { return state_seconds_ > 0 ? sum / state_seconds_ : 0; }

  std::optional<Stamp> last_;
  double seconds_ = 0;
  std::array<double, 4> by_health_{};  ///< s, by Health
  std::map<Doubt, double> by_doubt_;   ///< s
  std::uint32_t resets_ = 0;
  double state_seconds_ = 0;
  double pixel_sigma_s_ = 0;                                    ///< px s, over the time with a state
  double gyro_factor_s_ = 0, accel_factor_s_ = 0;               ///< s, over the time with a state
  double first_pixel_sigma_ = 0;                                ///< as configured
  double pose_variance_factor_s_ = 0;                           ///< s, over the time with a state
  double top_speed_ = 0;                                        ///< m/s
  double largest_velocity_sigma_ = 0, largest_tilt_sigma_ = 0;  ///< m/s, rad, while good
  std::optional<CalibrationEstimate> calibration_;              ///< the newest
};

}  // namespace swiftlet
