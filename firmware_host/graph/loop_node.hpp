#pragma once
// The node `loop`: keyframes with their images, one after the other, to places, loops and the pose graph.
//
// When it falls behind: it misses keyframes, or their images, counted; the next link bridges the gap where
// the window still holds both keyframes.

#include <vector>

#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

/// How the world of the newest epoch lies in the map. Nodes beyond the room of `out` are left out evenly, of
/// the kept map and of the flight; the newest is always listed.
void listWorlds(const LoopStage& stage, WorldsInMap& out);

class LoopNode final : public Node {
 public:
  explicit LoopNode(GraphContext& context);

  QueueIn<KeyframeMessage, kLoopKeyframes> keyframes{*this, "keyframes_to_loop", Arrow::kWakes};
  LoopImagesIn images{*this, "keyframe_images_to_loop", Arrow::kWaits};
  Out<LoopReport> reports{*this};
  Out<WorldsInMap> worlds{*this};
  Out<LoopStep> steps{*this};

  bool turn() override;
  /// Of the map that it flies in; all of one epoch.
  [[nodiscard]] std::vector<WorldInMap> keptNodes() const;
  /// Once it is done.
  [[nodiscard]] LoopStage& stage() { return stage_; }

 private:
  void step(const KeyframeMessage& message);
  /// The loop that this keyframe has closed, for who shows images.
  void sendLoop(Stamp keyframe);

  GraphContext& context_;
  ImageFeed* const view_;  ///< null: nobody shows images
  LoopStage stage_;
  std::uint32_t shown_loops_ = 0;
  LoopRevisit revisit_;
};

}  // namespace swiftlet
