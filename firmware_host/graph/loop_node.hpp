#pragma once
// The node `loop`: adds keyframes and their images, one by one, to places, loops and the pose graph.
//
// When it falls behind: keyframes or their images are missed, counted. The next link bridges the gap if the
// window still holds both keyframes.

#include <vector>

#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

/// Lists how the world of the newest epoch lies in the map. If there are more nodes than `out` can hold, the
/// nodes of the kept map and of the flight are thinned evenly; the newest is always listed.
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
  /// Nodes of the kept map that the flight uses, all of one epoch.
  [[nodiscard]] std::vector<WorldInMap> keptNodes() const;
  /// Only when the node is done.
  [[nodiscard]] LoopStage& stage() { return stage_; }

 private:
  void step(const KeyframeMessage& message);
  /// Sends the loop that this keyframe has closed to the viewer of images.
  void sendLoop(Stamp keyframe);

  GraphContext& context_;
  ImageFeed* const view_;  ///< null: no images are shown
  LoopStage stage_;
  std::uint32_t shown_loops_ = 0;
  LoopRevisit revisit_;
};

}  // namespace swiftlet
