#pragma once
// The stage of the thread `propagate`: every IMU sample gives a state at once, from the newest fix on.
//
// A fix is some frames old when it comes: the samples since its stamp are applied to it again, so that the
// output jumps by the correction and by nothing else. A fix of a new epoch forgets what was before.
// Frames, units: NavState's. Stamps: the sample's. Memory: 1024 samples, 60 kB, no allocation.
// Cost: some 2 us a sample; a fix costs as many samples again as have come since its stamp.

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
      : monitor_(noise), propagator_(inflatedNoise(noise, settings)) {}

  /// kNotReady: taken, but there is no state yet. kInvalidInput: dropped (not finite, stamp repeated or
  /// reversed). `state` may be null.
  Status step(const ImuSample& sample, NavState* state);

  /// A fix of another time line is ignored.
  void take(const StateFix& fix);

  /// The IMU's stamps went back for good (stamp_guard.hpp): what was before is forgotten; there is no state
  /// until the first fix of `timeline`.
  void restart(std::uint32_t timeline, Stamp first);

 private:
  SampleMonitor monitor_;
  Propagator propagator_;
  std::uint32_t timeline_ = 0;
  StateFix fix_;  // the newest; its epoch and health go with every state
};

}  // namespace swiftlet
