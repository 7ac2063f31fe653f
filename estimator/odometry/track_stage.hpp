#pragma once
// The stage of the thread `track`: images to tracks, with pixels predicted from the gyro and the newest
// window.
//
// Add samples before the first frame that is not earlier on the IMU's clock (Rig::sampleLead), and windows
// when they are available; an older window only makes predictions less accurate. A window of a new epoch
// drops the tracks. Memory: the front-end's 6.5 MiB at 752 x 480 stereo and half a MiB of samples; no
// allocation after the constructor. Cost, rules and sources: docs/odometry.md, docs/frontend.md.

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/frontend/frontend.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/propagation.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/effort.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/smoother/imu_buffer.hpp"

namespace swiftlet {

class TrackStage {
 public:
  TrackStage(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings);

  void addImu(const ImuSample& sample);

  /// Copies the window, from which the next frames are predicted. Windows of another time line are ignored.
  void take(const SmoothedWindow& window);

  /// Call if the IMU's stamps went back permanently (stamp_guard.hpp): discards samples, tracks and window.
  /// The calibration is kept.
  void restart(std::uint32_t timeline, Stamp first);

  /// kInvalidInput for a repeated or reversed stamp, a frame of another time line or without images, or an
  /// image of a wrong size; `tracked` is then unchanged, and the next tracked frame counts the refusal.
  Status step(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked);

  /// Observations lost by the front-end in the last successful step.
  [[nodiscard]] const LostSightings& lost() const { return frontend_.lost(); }

 private:
  Status process(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked);
  void forgetTracks();
  void predict(Stamp stamp);
  void predictLandmarks(Stamp stamp);

  Rig rig_;
  ImuNoise noise_;
  int max_features_;
  Frontend frontend_;
  SampleMonitor monitor_;
  Propagator propagator_;
  ImuBuffer imu_;
  SmoothedWindow window_;
  FrontendPrediction prediction_;
  std::uint32_t timeline_ = 0;
  bool restarted_ = false;  // no window of this time line yet
  bool imu_gap_ = false;    // since the last tracked frame
  bool has_frame_ = false;
  Stamp last_stamp_;
  int refused_ = 0;
  Stamp refused_stamp_;
};

}  // namespace swiftlet
