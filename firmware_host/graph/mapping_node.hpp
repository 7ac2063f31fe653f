#pragma once
// The node `map`: fuses frames with their images, depth and labels into volume, surface and distance field.
//
// When it falls behind: the oldest frames are not mapped, counted. If labels arrive after their images
// (GraphOptions::labels), frames are held for them. While no frame waits, spare turns correct what was fused
// before and update what the distance field left over; the number of spare turns is recorded.

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/held_frames.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/interfaces/fault_counts.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {

class MappingNode final : public Node {
 public:
  explicit MappingNode(GraphContext& context);

  QueueIn<MapMessage, 4 * kMapFrames> frames{*this, "frames_to_map", Arrow::kWakes};
  MapImagesIn images{*this, "frame_images_to_map", Arrow::kWaits};
  SceneIn scenes{*this, "scenes_to_map", Arrow::kWaits};
  LatestIn<WorldsInMap> worlds{*this, Arrow::kWaits};
  Out<MapRecord> records{*this};

  bool turn() override;
  void report(RunStatistics& statistics) const override;
  void addLosses(std::map<std::string, std::uint64_t>& losses) const override;

  /// Only when the node is done, except the distance field, which one other thread may read at any time.
  [[nodiscard]] MapStage& stage() { return stage_; }
  /// When the node is done: earlier epochs whose worlds loop closure has tied to the newest.
  [[nodiscard]] std::span<const std::uint32_t> tiedEpochs() const;

  /// Recorded schedule: one spare turn. False: there was nothing to do.
  bool spareTurn();
  /// Recorded schedule: ends the node after everything else was repeated.
  void end();
  /// Recorded schedule: skips a frame that the map had lost.
  void skip() { frames.pop(); }

 private:
  /// Data available for a frame; `image` null: its images are no longer available.
  struct AtHand {
    const std::array<ImageView, kMaxCameras>* image = nullptr;
    std::array<std::uint64_t, kMaxCameras> number{};
    SceneImages scene;
  };

  void take(const MapMessage& message, const AtHand& at_hand);
  [[nodiscard]] AtHand findFor(const MapMessage& message);
  void holdFrames();
  bool takeHeldFrame();
  bool useSpareTime(bool ended);
  void correct();
  void stepCorrection();
  /// False: nothing was fused into the map.
  bool fuse(const MapMessage& message, const AtHand& at_hand);
  void draw();
  void publishSurface(Stamp stamp);
  void publishObstacle(Stamp stamp, const SE3& T_map_body);
  void record(const MapStep& step, const SceneImages& scene);
  void spend(StageId stage, auto&& work) { context_.count(stage, context_.timed(stage, work)); }

  GraphContext& context_;
  MapStage stage_;
  std::unique_ptr<HeldFrames> held_;  ///< null: no labels are expected
  std::uint64_t worlds_ = 0;
  std::uint64_t spare_turns_ = 0;  ///< since the last frame
  CorrectionStep corrected_;
  Eigen::Vector3d vehicle_ = Eigen::Vector3d::Zero();  ///< in the map
  MapReport report_;

  std::uint64_t taken_ = 0;          ///< frames to be mapped
  std::uint64_t without_image_ = 0;  ///< of these, skipped because their images were no longer available
  std::uint64_t without_scene_ = 0;  ///< of these, skipped: depth sensor in use, but its depth was gone
  std::uint64_t refused_ = 0;        ///< by the stage
  FaultCounts faults_;
};

}  // namespace swiftlet
