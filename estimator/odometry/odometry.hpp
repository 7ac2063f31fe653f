#pragma once
// The odometry: front-end, IMU and smoother with health, for programs with one thread.
//
// Two steps per frame: `track` (images to tracks) and `smooth` (tracks and IMU to states). Add IMU samples as
// they arrive, each before the first frame that is not earlier on the IMU's clock (its stamp and
// Rig::sampleLead). No clock, no files, no threads. Memory: about 24 MiB at 752 x 480 stereo, reserved by the
// constructor; no allocation afterwards. Frames: T_world_body; world is gravity-aligned with z up, with
// origin and yaw of the epoch's first state. Stamps: frames have the image clock, propagated states the IMU's
// clock. Rules of start, health, events and reset: docs/odometry.md.

#include <memory>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/effort.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/odometry_settings.hpp"

namespace swiftlet {

class Odometry {
 public:
  Odometry(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings);
  ~Odometry();

  /// Takes one sample. Writes the state propagated to it if `propagated` is not null and a state exists
  /// (otherwise kNotReady). kInvalidInput if it is not finite or its stamp is repeated or reversed; it is
  /// then dropped, with an event.
  Status addImu(const ImuSample& sample, NavState* propagated = nullptr);

  /// Images to tracks. kInvalidInput for a repeated or reversed stamp (with an event), a frame without
  /// images, or an image of a wrong size.
  Status track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked);

  /// Tracks (from `track`, or from a file) to states. kOk without a state while the start waits
  /// (`output.waiting_for`). kFailed if the window could not be solved; it was then reset.
  Status smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output);

  /// Outputs the keyframes still in the window; call at the end of a run.
  void finish(OdometryOutput& output);

  /// Discards the state and starts a new epoch; also allowed in flight.
  void reset();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace swiftlet
