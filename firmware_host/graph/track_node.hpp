#pragma once
// The node `track`: pairs images and passes them to the front-end.
//
// When it falls behind: the oldest frames are dropped (frame_queue.hpp), and its effort is reduced. It waits
// while the queue to `smooth` is full, so tracked frames are never lost.

#include <cstdint>
#include <memory>

#include "estimator/odometry/track_stage.hpp"
#include "firmware_host/graph/frame_queue.hpp"
#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/keyframe_copies.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/graph/sample_in.hpp"

namespace swiftlet {

class TrackNode final : public Node {
 public:
  TrackNode(GraphContext& context, const SensorNode& sensors);

  FrameQueue frames;
  SampleIn samples{*this, "imu_to_track", Arrow::kWaits};
  LatestIn<SmoothedWindow> window{*this, Arrow::kFeedback};
  QueueIn<SceneNote, 4 * kMapFrames> scene_notes{*this, "scenes_to_track", Arrow::kWaits};
  Out<TrackMessage> tracked{*this};
  Out<TrackStep> steps{*this};
  KeyframeCopies copies{*this};  ///< copies of a frame's images, for `loop` and `map`

  bool turn() override;
  void report(RunStatistics& statistics) const override;
  void addLosses(std::map<std::string, std::uint64_t>& losses) const override;
  /// Replaces images: only the back-end runs. Called from the thread that runs all nodes. `timeline`: of the
  /// IMU's newest sample. False: there is no room.
  bool takeTracks(const TrackedFrame& frame, std::uint32_t timeline);

 private:
  void trackFrame();
  void refuse(const FrameQueue::Refusal& refusal);
  bool flushAndFinish();
  [[nodiscard]] bool wantsMap(const StereoFrame& frame, bool keyframe);

  GraphContext& context_;
  ConstantEffort full_effort_;
  EffortSource* effort_;
  ImageFeed* const view_;  ///< null: no images are shown
  TrackStage stage_;
  std::uint64_t window_ = 0;
  std::uint64_t next_frame_ = 0;
};

}  // namespace swiftlet
