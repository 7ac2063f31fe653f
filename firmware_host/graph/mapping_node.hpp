#pragma once
// The node `map`: frames with their images, depth and labels, to volume, surface and distance field.
//
// When it falls behind: frames go by unmapped, the oldest first, counted. Where labels come after their
// images (GraphOptions::labels) frames are held for them. Spare time, while no frame waits, goes to
// corrections of what was fused before and to what the distance field left over; how much of it there was is
// recorded.

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

  /// Once it is done, but for the distance field, which any one thread may read at any time.
  [[nodiscard]] MapStage& stage() { return stage_; }
  /// Once it is done: earlier epochs whose worlds loop closure has tied to the newest.
  [[nodiscard]] std::span<const std::uint32_t> tiedEpochs() const;

  /// Recorded schedule: the work of one turn in spare time. False: there was none to do.
  bool spareTurn();
  /// Recorded schedule: the end, once all else was repeated.
  void end();
  /// Recorded schedule: passes a frame by that was lost to the map.
  void skip() { frames.pop(); }

 private:
  /// What is at hand for a frame; null: its images are gone.
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
  /// False: no image was taken into the map.
  bool fuse(const MapMessage& message, const AtHand& at_hand);
  void draw();
  void publishSurface(Stamp stamp);
  void publishObstacle(Stamp stamp, const SE3& T_map_body);
  void record(const MapStep& step, const SceneImages& scene);
  void spend(StageId stage, auto&& work) { context_.count(stage, context_.timed(stage, work)); }

  GraphContext& context_;
  MapStage stage_;
  std::unique_ptr<HeldFrames> held_;  ///< null if no labels are waited for
  std::uint64_t worlds_ = 0;
  std::uint64_t spare_turns_ = 0;  ///< since the last frame
  CorrectionStep corrected_;
  Eigen::Vector3d vehicle_ = Eigen::Vector3d::Zero();  ///< in the map
  MapReport report_;

  std::uint64_t taken_ = 0;          ///< frames that were to be mapped
  std::uint64_t without_image_ = 0;  ///< of them, skipped: others came before they were looked at
  std::uint64_t without_scene_ = 0;  ///< of them, whose depth or labels were gone
  std::uint64_t refused_ = 0;        ///< by the stage
  FaultCounts faults_;
};

}  // namespace swiftlet
