#pragma once
// What the odometry says after each frame, beside the newest state.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"

namespace swiftlet {

enum class EventKind : std::uint8_t {
  kImuGap,           ///< value: seconds without a sample
  kImuSaturated,     ///< value: samples
  kImuInvalid,       ///< value: samples dropped (NaN, repeated or reversed stamp)
  kFrameDropped,     ///< value: frames refused (repeated or reversed stamp, wrong size)
  kCameraLost,       ///< value: camera
  kCameraBack,       ///< value: camera
  kBlackoutStarted,  ///< value: seconds without an accepted image, more than "good" allows
  kBlackoutEnded,    ///< value: seconds it lasted
  kRestStarted,
  kRestEnded,
  kInitialized,      ///< value: seconds since the first image
  kHealthChanged,    ///< value: the new Health
  kReset,            ///< value: the new epoch
  kCapacityReached,  ///< value: items given up
  kStampsWentBack,   ///< value: seconds by which the IMU's stamps went back for good; a new epoch begins
  kDoubt,            ///< value: the Doubt by which health is not good
};

/// Why health is not good: the first condition that holds, in this order.
enum class Doubt : std::uint8_t {
  kNone,
  kNoImage,         ///< no image accepted for 0.3 s: coasting on the IMU
  kImplausible,     ///< speed or acceleration above the vehicle's limits
  kTracksDisagree,  ///< many tracks do not fit one motion: calibration, rolling shutter, stamps or a moving
                    ///< scene
  kImuDisagrees,    ///< IMU residuals too large: extrinsics, axes, stamps or noise densities
  kUncertain,       ///< sigma of velocity or tilt too large
  kScaleDisagrees,  ///< one camera: the accelerometer contradicts the scale
  kScaleUnknown,    ///< one camera: not enough acceleration yet to confirm the scale
  kSettling,        ///< shortly after a start or after another doubt
  kCameraMissing,
  kFewSightings,
};

struct Event {
  Stamp stamp;
  EventKind kind = EventKind::kReset;
  double value = 0;
};

/// One frame's figures: what a user looks at first when a run goes wrong.
struct FrameStatistics {
  bool keyframe = false;
  bool at_rest = false;
  int tracks = 0;                   ///< features handed in
  int known = 0;                    ///< of these, features whose landmark has earlier sightings in the window
  int landmarks = 0;                ///< landmarks in the solved window
  int inliers_mono = 0;             ///< accepted sightings of this frame, by one camera
  int inliers_stereo = 0;           ///< accepted, by both cameras
  double track_length = 0;          ///< mean frames a track of this frame has lived
  double reprojection_rms = 0;      ///< px, accepted sightings of the window
  NoiseInUse noise;                 ///< for this frame's sightings and the motion to it
  double pose_variance_factor = 1;  ///< in the covariances, for tracks whose errors last
  double imu_residual = 0;  ///< whitened IMU residuals of the window, RMS (1: as the noise in use says)
  /// One camera: true over estimated length, as the accelerometer says, and its sigma (scale_check.hpp).
  double scale = 1;
  double scale_sigma = 0;
  int iterations = 0;
};

/// A keyframe as it leaves the window (or at the end of the run).
struct KeyframeState {
  NavState state;
  FrameStatistics statistics;
};

struct OdometryOutput {
  bool has_state = false;        ///< false until the first pose of an epoch
  const char* waiting_for = "";  ///< literal text while initializing
  NavState state;
  FrameStatistics statistics;
  Doubt doubt = Doubt::kSettling;  ///< none: health is good
  CalibrationEstimate calibration;
  FixedVector<KeyframeState, kMaxStates> left_window;
  FixedVector<Event, 32> events;
};

}  // namespace swiftlet
