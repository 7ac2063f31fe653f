#pragma once
// The stage of the thread `smooth`: tracks and IMU to states, with start, health and events.
//
// A step has two parts: `step` outputs the state as early as possible; `trim` then makes room in the window
// (marginalization). Read the fix for propagation after `step`, and the window for tracking after `trim`. Add
// samples before the first frame that is not earlier on the IMU's clock (Rig::sampleLead). Memory: 16.6 MiB,
// of which 0.9 MiB are waiting frames (one camera) and half a MiB samples; the rest is the smoother's. No
// allocation after the constructor. Rules of start, health, events and reset: docs/odometry.md.

#include <optional>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/rest_detector.hpp"
#include "estimator/imu/sample_monitor.hpp"
#include "estimator/messages/effort.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/keyframe_link.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/state_fix.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/event_watch.hpp"
#include "estimator/odometry/health_monitor.hpp"
#include "estimator/odometry/image_stillness.hpp"
#include "estimator/odometry/mono_starter.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "estimator/odometry/odometry_settings.hpp"
#include "estimator/odometry/plane_ties.hpp"
#include "estimator/odometry/scale_check.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

class SmoothStage {
 public:
  SmoothStage(const Rig& rig, const ImuNoise& noise, const OdometrySettings& settings);

  void addImu(const ImuSample& sample);

  /// Takes planes of the mesher, applied at the beginning of the next step. No effect unless
  /// `regularity_enabled`. Reports of another epoch are ignored.
  void take(const PlaneReport& report);

  /// kOk without a state while the start waits (`output.waiting_for`). kFailed if the window could not be
  /// solved; it was then reset, with a new epoch. kInvalidInput, without effect, for a frame of another time
  /// line than the samples.
  Status step(const TrackedFrame& tracked, const Effort& effort, OdometryOutput& output);
  /// Call after every step. Keyframes that leave the window are in the next output.
  void trim();

  /// The newest state, if there is one, and the epoch; call right after `step`.
  void fix(StateFix& out) const { out = fix_; }
  /// The newest window; call after `trim`.
  void window(SmoothedWindow& out) const;
  /// Pose of the newest keyframe relative to the previous one in `window`, which must be the result of
  /// `window()` after `trim`.
  void link(const SmoothedWindow& window, KeyframeLink& out);
  [[nodiscard]] const PlaneTies& planeTies() const { return ties_; }

  /// At the end of a run: the keyframes still in the window and the remaining events.
  void finish(OdometryOutput& output);

  /// Discards the state and starts a new epoch.
  void reset();

  /// Call if the IMU's stamps went back permanently (stamp_guard.hpp); `first` is the first sample of the new
  /// time line. Like reset(), and discards the samples, with an event.
  void restart(std::uint32_t timeline, Stamp first);

 private:
  bool start(const TrackedFrame& tracked, OdometryOutput& output);
  /// Discards the estimate. The next one is in the same world, at the pose set by leave().
  void endEpoch();
  void leave(const StartState& at);
  void giveUp();
  static void goOnFrom(const SE3& place, BodyState& state);
  Status restartFromCoast(const Smoother::StepInput& input);
  [[nodiscard]] StartState newestAsStart() const;
  Status catchUp();
  Status fail(const Status& status, OdometryOutput& output);
  /// Whether the epoch is in its first second.
  [[nodiscard]] bool starting(Stamp stamp) const;
  void publish(const TrackedFrame& tracked, bool imu_missing, OdometryOutput& output);
  void deliver(OdometryOutput& output);
  void handOver();

  Rig rig_;
  ImuNoise noise_;
  OdometrySettings settings_;
  Smoother smoother_;
  PlaneTies ties_;
  SampleMonitor monitor_;
  RestDetector rest_;
  ImageStillness stillness_;
  ScaleCheck scale_;
  HealthMonitor health_;
  MonoStarter mono_starter_;
  ImuBuffer imu_;
  CalibrationEstimate calibration_;
  EventBuffer events_;
  EventWatch watch_;
  StateFix fix_;
  FixedVector<KeyframeState, kMaxStates> left_;       // not yet delivered
  FixedVector<KeyframeState, kMaxStates> left_step_;  // by one step
  bool trim_due_ = false;
  std::uint32_t epoch_ = 0;
  std::uint32_t timeline_ = 0;
  Stamp last_stamp_;  // of the newest tracked frame
  bool imu_gap_ = false;
  Stamp gap_end_;      // of the last gap in the samples
  bool lost_ = false;  // samples were missing while no image was accepted: the position is unknown
  std::optional<StartState> left_at_;  // start of the next epoch; biases are valid unless their sigma is 0
  std::optional<SE3> last_good_;       // T_world_body
  std::optional<SE3> last_useful_;     // T_world_body
  std::optional<Stamp> epoch_began_;   // its first frame
  std::optional<Stamp> last_rest_;     // in this epoch
};

}  // namespace swiftlet
