#pragma once
// The odometry: front-end, IMU and smoother joined, with health.
//
// Two steps a frame, so that an executor may run them on two threads: `track` (images to tracks)
// and `smooth` (tracks and IMU to states). IMU samples are handed in as they arrive, each before
// the first frame whose stamp is not earlier. No clock, no files, no threads; everything is
// reserved by the constructor, nothing is allocated after it: about 24 MiB at 752 x 480 stereo.
// Frames: T_world_body, world gravity-aligned with z up, origin and yaw of the epoch's first state.
// Stamps: those of images on the image clock, of propagated states on the IMU's. Rules of start, health,
// events and reset: docs/odometry.md.

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

  /// Takes one sample; gives the state propagated to it when `propagated` is not null and a state
  /// exists (kNotReady otherwise). kInvalidInput (dropped, event) when it is not finite, or its stamp
  /// repeats or goes back.
  Status addImu(const ImuSample& sample, NavState* propagated = nullptr);

  /// Images to tracks. kInvalidInput for a repeated or reversed stamp (event), for a frame without
  /// images and for an image of the wrong size.
  Status track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked);

  /// Tracks (from `track`, or from a file) to states. kOk without a state while the start waits
  /// (`output.waiting_for`). kFailed when the window could not be solved: it has been reset by then.
  Status smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output);

  /// At the end of a run: the keyframes still in the window.
  void finish(OdometryOutput& output);

  /// Forgets the state and starts again, in flight too; raises the epoch.
  void reset();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace swiftlet
