#pragma once
// The output of the odometry after each frame, besides the newest state.

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
  kBlackoutStarted,  ///< value: seconds without an accepted image, more than health "good" allows
  kBlackoutEnded,    ///< value: seconds it lasted
  kRestStarted,
  kRestEnded,
  kInitialized,      ///< value: seconds since the first image
  kHealthChanged,    ///< value: the new Health
  kReset,            ///< value: the new epoch
  kCapacityReached,  ///< value: items dropped
  kStampsWentBack,   ///< value: seconds by which the IMU's stamps went back for good; a new epoch begins
  kDoubt,            ///< value: the Doubt that prevents health "good"
};

/// The reason why health is not good: the first condition in this order that holds.
enum class Doubt : std::uint8_t {
  kNone,
  kNoImage,  ///< no image accepted for 0.3 s, longer for slow cameras (HealthMonitor::goodAge()): coasting on
             ///< the IMU
  kImplausible,     ///< speed or acceleration above the vehicle's limits
  kTracksDisagree,  ///< many tracks contradict a single motion: wrong calibration, rolling shutter or stamps,
                    ///< or a moving scene
  kImuDisagrees,    ///< IMU residuals too large: wrong extrinsics, axes, stamps or noise densities
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

/// Figures of one frame, to diagnose a run.
struct FrameStatistics {
  bool keyframe = false;
  bool at_rest = false;
  int tracks = 0;               ///< input features
  int known = 0;                ///< of these, features whose landmark has earlier observations in the window
  int landmarks = 0;            ///< landmarks in the solved window
  int inliers_mono = 0;         ///< accepted observations of this frame by one camera
  int inliers_stereo = 0;       ///< accepted observations of this frame by both cameras
  double track_length = 0;      ///< mean length of this frame's tracks, in frames
  double reprojection_rms = 0;  ///< px, over accepted observations of the window
  NoiseInUse noise;             ///< for this frame's observations and the motion to it
  double pose_variance_factor = 1;  ///< factor on the covariances for correlated errors of tracks
  double imu_residual = 0;          ///< RMS of the window's whitened IMU residuals (1: as the noise in use)
  /// One camera: true over estimated length by the accelerometer, and its sigma (scale_check.hpp).
  double scale = 1;
  double scale_sigma = 0;
  int iterations = 0;
};

/// A keyframe when it leaves the window (or at the end of the run).
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
