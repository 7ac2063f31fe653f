#pragma once
// The stage of the thread `propagate`: a state for every IMU sample at once, propagated from the newest fix.
//
// A fix is some frames old when it arrives. The samples since its stamp are re-applied to it, so the output
// jumps only by the correction. A fix of a new epoch replaces everything before. Frames, units: those of
// NavState. Stamps: those of the samples. Memory: 1024 samples, 60 kB, no allocation. Cost: about 2 us per
// sample; a fix costs that for each sample since its stamp.

#include "estimator/core/status.hpp"
#include "estimator/imu/propagation.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/state_fix.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "estimator/odometry/odometry_settings.hpp"

namespace swiftlet {

class PropagationStage {
 public:
  PropagationStage(const ImuNoise& noise, const OdometrySettings& settings)
      : monitor_(inflatedNoise(noise, settings)), propagator_(monitor_.noise()) {}

  /// kNotReady: the sample was taken, but there is no state yet. kInvalidInput: it was dropped (not finite,
  /// stamp repeated or reversed). `state` may be null.
  Status step(const ImuSample& sample, NavState* state);

  /// Takes a fix; ignored if it is of another time line.
  void take(const StateFix& fix);

  /// Call if the IMU's stamps went back permanently (stamp_guard.hpp): forgets everything before. There is no
  /// state until the first fix of `timeline`.
  void restart(std::uint32_t timeline, Stamp first);

 private:
  SampleMonitor monitor_;
  Propagator propagator_;
  std::uint32_t timeline_ = 0;
  StateFix fix_;  // the newest; gives every state its epoch and health
};

}  // namespace swiftlet
