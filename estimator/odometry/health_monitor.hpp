#pragma once
// Health: the accuracy class of the estimate, updated after each solve.
//
//  initializing  until the epoch is without doubt for the first time (a missing camera or few observations
//                do not count)
//  good          no doubt now, nor during the preceding settling time (0.45 s of accepted images, 2 s after a
//                disagreement)
//  degraded      a doubt; or coasting on the IMU for less than 3 s
//  failed        no accepted image (8 observations) for 3 s; or, once initialized, figures far outside the
//                limits
// Doubt (odometry_output.hpp) lists the conditions: bounds on the sigmas of velocity and tilt, on the share
// of inliers, on the IMU residuals relative to the noise model, on speed and acceleration, and with one
// camera on the disagreement with the accelerometer's scale (scale_check.hpp).
// tests/odometry/health_statistics.cpp measures them on good and faulty flights. `lost()` requests a new
// epoch: figures far outside the limits for 2 s, or with one camera a contradicted start (1 s) or scale (3
// s). The settling time doubles after each such loss. Observations by both cameras count once. No memory,
// O(1).

#include <algorithm>
#include <cstdint>
#include <optional>

#include "estimator/core/usual_interval.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_settings.hpp"

namespace swiftlet {

class HealthMonitor {
 public:
  /// s without an accepted image after which health is no longer good, for cameras with 20 Hz or more.
  static constexpr double kGoodAge = 0.3;
  /// For slower cameras: s by which the image may be later than usual.
  static constexpr double kGoodDelay = 0.25;
  /// s without an accepted image after which a new epoch begins, unless the image shows known landmarks.
  static constexpr double kLongCoast = 1.0;
  /// Least number of accepted observations of an accepted frame.
  static constexpr int kMinSightings = 8;
  /// Least number of accepted observations for good health.
  static constexpr int kNominalSightings = 25;

  HealthMonitor(const OdometrySettings& settings, std::size_t cameras)
      : max_speed_(settings.max_speed),
        max_acceleration_(settings.max_acceleration),
        pixel_sigma_(settings.pixel_sigma),
        cameras_(cameras) {}

  void reset();

  struct Evidence {
    const TrackedFrame& frame;
    const FrameStatistics& statistics;
    const NavState& state;     ///< with its covariance
    bool imu_missing = false;  ///< samples were missing since the last frame
    bool first_of_epoch = false;
    bool scale_known = false;  ///< one camera: scale confirmed in this epoch (ScaleCheck)
  };
  /// Updates after a solve.
  Health update(const Evidence& evidence);

  /// The health after the last update.
  [[nodiscard]] Health health() const { return health_; }
  /// Why health is not good.
  [[nodiscard]] Doubt doubt() const { return doubt_; }
  /// s of good health in this epoch.
  [[nodiscard]] double secondsGood() const { return good_; }
  /// Whether the state should be discarded and a new epoch started.
  [[nodiscard]] bool lost() const { return lost_; }
  /// Whether the figures are not far outside the limits, so that a new epoch may continue from the position.
  [[nodiscard]] bool useful() const { return beyond_use_ == 0; }
  /// The health at a later stamp without a new frame: missing images degrade it.
  [[nodiscard]] Health at(Stamp stamp) const;
  /// The same from the last health, the stamp of the last accepted image and goodAge().
  [[nodiscard]] static Health aged(Health health, Stamp last_accepted, double good_age, Stamp stamp);
  /// s without an accepted image after which health is no longer good; depends on the usual interval of the
  /// images.
  [[nodiscard]] double goodAge() const { return std::max(kGoodAge, interval_.get().seconds() + kGoodDelay); }
  /// Stamp of the last accepted frame of the epoch; valid after its first update.
  [[nodiscard]] Stamp lastAccepted() const { return last_accepted_; }
  [[nodiscard]] double secondsWithoutImage(Stamp stamp) const;

 private:
  void average(const Evidence& evidence, double seconds);
  [[nodiscard]] Doubt inputDoubt(const Evidence& evidence) const;
  [[nodiscard]] Doubt accuracyDoubt(const Evidence& evidence) const;
  [[nodiscard]] Doubt scaleDoubt(const Evidence& evidence) const;
  [[nodiscard]] double settlingTime() const;
  [[nodiscard]] bool contradicted(const FrameStatistics& statistics) const;
  [[nodiscard]] bool beyondUse(const NavState& state) const;

  double max_speed_;
  double max_acceleration_;
  double pixel_sigma_;  // px, as configured
  std::size_t cameras_;
  Health health_ = Health::kInitializing;
  Doubt doubt_ = Doubt::kSettling;
  bool has_image_ = false;
  Stamp last_accepted_;
  std::optional<Stamp> last_;  ///< last frame of the epoch
  UsualInterval interval_;     ///< between frames; kept across epochs
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();
  double settled_ = 0;       ///< s of accepted images since the last doubt
  double share_ = 1;         ///< share of a frame's observations that fit, low pass
  double imu_square_ = 0;    ///< squared IMU residual, low pass
  double acceleration_ = 0;  ///< m/s^2, low pass
  double beyond_use_ = 0;    ///< s
  double contradicted_ = 0;  ///< s
  bool disagreed_ = false;   // since health was good
  bool was_good_ = false;    ///< in this epoch
  double good_ = 0;          ///< s, in this epoch
  int losses_ = 0;           ///< lost epochs that still extend the settling time
  bool lost_ = false;
};

}  // namespace swiftlet
