#pragma once
// The node `smooth`: tracked frames and samples to states, the window and all that follows from it.
//
// When it falls behind: its effort falls, and `track` waits for it. The state goes out before room is made in
// the window: marginalization costs no latency.

#include <array>
#include <cstdint>

#include "estimator/core/newest_shared.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/graph/sample_in.hpp"

namespace swiftlet {

/// The newest frame that was smoothed, or waits for initialization.
struct SmoothedFrameNews {
  std::uint64_t count = 0;
  Stamp stamp;
  bool has_state = false;
  Health health = Health::kInitializing;
  std::uint32_t epoch = 0;
  int track_level = 0;
  int smooth_level = 0;
  std::array<double, 3> world_up{0, 0, 1};  ///< in the IMU's axes
};

class SmoothNode final : public Node {
 public:
  explicit SmoothNode(GraphContext& context);

  QueueIn<TrackMessage, kTrackedRing> tracked{*this, nullptr, Arrow::kWakes};
  SampleIn samples{*this, "imu_to_smooth", Arrow::kWaits};
  LatestIn<PlaneReport> planes{*this, Arrow::kHint};
  Out<StateFix> fix{*this};
  Out<FrameResult> results{*this};
  Out<SmoothedWindow> window{*this};
  Out<MeshMessage> mesh{*this};           ///< the window with its frame
  Out<KeyframeMessage> keyframes{*this};  ///< with window and link to the one before
  Out<MapMessage> mapped{*this};          ///< frames whose images have gone to the map
  Out<SmoothStep> steps{*this};

  bool turn() override;

  /// Any thread. `count` is 0 before the first.
  [[nodiscard]] SmoothedFrameNews newestFrame() const;

 private:
  void take(const TrackMessage& message);
  void smoothFrame(const TrackMessage& message, FrameResult& out);
  void publishWindow(const TrackMessage& message);
  void sendKeyframe(const TrackMessage& message, const SmoothedWindow& smoothed);
  void sendMapped(const TrackMessage& message, const SmoothedWindow& smoothed);
  /// For who shows images.
  void sendSight(const TrackMessage& message, const SmoothedWindow& smoothed);
  void end();

  GraphContext& context_;
  ConstantEffort full_effort_;
  EffortSource* effort_;
  ImageFeed* const view_;  ///< null: nobody shows images
  ShownInstants shown_;
  SmoothStage stage_;
  std::uint64_t planes_ = 0;
  std::uint64_t windows_ = 0;  ///< published
  SmoothedFrameNews frame_;
  NewestShared<SmoothedFrameNews> newest_frame_;
};

}  // namespace swiftlet
