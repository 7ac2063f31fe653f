#pragma once
// The node `smooth`: estimates states and the window from tracked frames and samples.
//
// When it falls behind: its effort is reduced, and `track` waits for it. The state is published before the
// window is trimmed, so marginalization adds no latency.

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
  Out<MeshMessage> mesh{*this};           ///< the window and its newest frame
  Out<KeyframeMessage> keyframes{*this};  ///< with their window and the link to the previous keyframe
  Out<MapMessage> mapped{*this};          ///< frames whose images were sent to the map
  Out<SmoothStep> steps{*this};

  bool turn() override;

  /// Any thread. `count` is 0 before the first frame.
  [[nodiscard]] SmoothedFrameNews newestFrame() const;

 private:
  void take(const TrackMessage& message);
  void smoothFrame(const TrackMessage& message, FrameResult& out);
  void publishWindow(const TrackMessage& message);
  void sendKeyframe(const TrackMessage& message, const SmoothedWindow& smoothed);
  void sendMapped(const TrackMessage& message, const SmoothedWindow& smoothed);
  /// For the viewer of images.
  void sendSight(const TrackMessage& message, const SmoothedWindow& smoothed);
  void end();

  GraphContext& context_;
  ConstantEffort full_effort_;
  EffortSource* effort_;
  ImageFeed* const view_;  ///< null: no images are shown
  ShownInstants shown_;
  SmoothStage stage_;
  std::uint64_t planes_ = 0;
  std::uint64_t windows_ = 0;  ///< published
  SmoothedFrameNews frame_;
  NewestShared<SmoothedFrameNews> newest_frame_;
};

}  // namespace swiftlet
