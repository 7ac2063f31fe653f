#pragma once
// Health: a statement of the estimate's accuracy, made after each solve.
//
//  initializing  until the epoch is good for the first time
//  good          no doubt now, nor during the settling time (0.45 s of accepted images, 2 s after a
//                disagreement) before
//  degraded      a doubt; or coasting on the IMU for less than 3 s
//  failed        no accepted image (8 sightings) for 3 s; or, after the epoch was good, figures far outside
//                the limits
// Doubt (odometry_output.hpp) lists the conditions: bounds on the sigmas of velocity and tilt, on the share
// of inliers, on the IMU residuals relative to the noise model, on speed and acceleration, and with one
// camera on the disagreement with the accelerometer's scale (scale_check.hpp).
// tests/odometry/health_statistics.cpp shows what they achieve on good and faulty flights. `lost()` asks for
// a new epoch: figures far outside the limits for 2 s, or with one camera a contradicted start (1 s) or scale
// (3 s). After each such loss the settling time doubles. Sightings by both cameras count once. No memory,
// O(1).

#include <cstdint>
#include <optional>

#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_settings.hpp"

namespace swiftlet {

class HealthMonitor {
 public:
  /// s without an accepted image before "good" ends.
  static constexpr double kGoodAge = 0.3;
  /// s without an accepted image after which a new epoch begins, unless the image shows what is known.
  static constexpr double kLongCoast = 1.0;
  /// A frame with fewer accepted sightings is not accepted.
  static constexpr int kMinSightings = 8;
  /// With fewer it is not good.
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
    bool scale_known = false;  ///< one camera: confirmed in this epoch (ScaleCheck)
  };
  /// After a solve.
  Health update(const Evidence& evidence);

  /// The health after the last update.
  [[nodiscard]] Health health() const { return health_; }
  /// Why it is not good.
  [[nodiscard]] Doubt doubt() const { return doubt_; }
  /// s of good in this epoch.
  [[nodiscard]] double secondsGood() const { return good_; }
  /// The state should be discarded and started again.
  [[nodiscard]] bool lost() const { return lost_; }
  /// Not far outside the limits: the position may be gone on from.
  [[nodiscard]] bool useful() const { return beyond_use_ == 0; }
  /// The health at a later stamp without a new frame: images that stay away degrade it.
  [[nodiscard]] Health at(Stamp stamp) const;
  /// The same for who has only the last verdict and the stamp of the last accepted image.
  [[nodiscard]] static Health aged(Health health, Stamp last_accepted, Stamp stamp);
  /// Of the epoch; meaningful after its first update.
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
  double pixel_sigma_;  // px, as set
  std::size_t cameras_;
  Health health_ = Health::kInitializing;
  Doubt doubt_ = Doubt::kSettling;
  bool has_image_ = false;
  Stamp last_accepted_;
  std::optional<Stamp> last_;  ///< frame of the epoch
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();
  double settled_ = 0;       ///< s of accepted images since the last doubt
  double share_ = 1;         ///< of a frame's sightings that fit, low pass
  double imu_square_ = 0;    ///< of the IMU's residual, low pass
  double acceleration_ = 0;  ///< m/s^2, low pass
  double beyond_use_ = 0;    ///< s
  double contradicted_ = 0;  ///< s
  bool disagreed_ = false;   // since it was good
  bool was_good_ = false;    ///< in this epoch
  double good_ = 0;          ///< s, in this epoch
  int losses_ = 0;           ///< epochs given up, not forgiven yet
  bool lost_ = false;
};

}  // namespace swiftlet
