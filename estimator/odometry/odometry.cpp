#include "estimator/odometry/odometry.hpp"

#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/state_fix.hpp"
#include "estimator/odometry/propagation_stage.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "estimator/odometry/track_stage.hpp"

namespace swiftlet {

class Odometry::Impl {
 public:
  Impl(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
      : propagation_(noise, settings), track_(rig, noise, settings), smooth_(rig, noise, settings) {}

  Status addImu(const ImuSample& sample, NavState* propagated) {
    track_.addImu(sample);
    smooth_.addImu(sample);
    return propagation_.step(sample, propagated);
  }

  Status track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
    return track_.step(frame, effort, tracked);
  }

  Status smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output) {
    const Status status = smooth_.step(tracked, effort, output);
    smooth_.trim();
    feedBack();
    return status;
  }

  void finish(OdometryOutput& output) { smooth_.finish(output); }

  void reset() {
    smooth_.reset();
    feedBack();
  }

 private:
  /// Passes the newest state to propagation and the newest window to tracking.
  void feedBack() {
    smooth_.fix(fix_);
    propagation_.take(fix_);
    smooth_.window(window_);
    track_.take(window_);
  }

  PropagationStage propagation_;
  TrackStage track_;
  SmoothStage smooth_;
  StateFix fix_;
  SmoothedWindow window_;
};

Odometry::Odometry(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings)
    : impl_(std::make_unique<Impl>(rig, noise, settings)) {}
Odometry::~Odometry() = default;
Status Odometry::addImu(const ImuSample& sample, NavState* propagated) {
  return impl_->addImu(sample, propagated);
}
Status Odometry::track(const StereoFrame& frame, const Effort& effort, TrackedFrame& tracked) {
  return impl_->track(frame, effort, tracked);
}
Status Odometry::smooth(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output) {
  return impl_->smooth(tracked, effort, output);
}
void Odometry::finish(OdometryOutput& output) { impl_->finish(output); }
void Odometry::reset() { impl_->reset(); }

}  // namespace swiftlet
