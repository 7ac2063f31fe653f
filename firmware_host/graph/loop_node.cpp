#include "firmware_host/graph/loop_node.hpp"

namespace swiftlet {

LoopNode::LoopNode(GraphContext& context)
    : Node("loop", Rank::kLow),
      context_(context),
      stage_(context.rig, context.settings.loop_stage, LoopLimits{},
             context.options.vocabulary != nullptr ? *context.options.vocabulary : Vocabulary::shipped()) {}

bool LoopNode::turn() {
  const bool ended = inputEnded();
  const KeyframeMessage* message = keyframes.front();
  if (message == nullptr) {
    if (ended) {
      images.clear();
      finish();
    }
    return false;
  }
  step(*message);
  keyframes.pop();
  return true;
}

void LoopNode::step(const KeyframeMessage& message) {
  LoopInput input;
  input.tracks = &message.tracked;
  input.window = &message.window;
  input.link = &message.link;
  LoopStep taken{message.tracked.index, message.window_number, {}};
  const KeyframeImages* at_hand =
      images.find(message.tracked.index, [](const KeyframeImages& of) { return of.frame; });
  if (at_hand != nullptr) {
    input.image = at_hand->image;
    taken.image = at_hand->number;
  }
  const Spent spent = context_.timed(StageId::kLoop, [&] {
    static_cast<void>(stage_.step(input, LoopEffort{}, reports.draft()));
    if (worlds.connected()) publishWorlds();
    for (LiveOutlet* outlet : context_.options.outlets) outlet->correction.write(stage_.correction());
    reports.send();
  });
  context_.count(StageId::kLoop, spent);
  steps.send(taken);
}

void LoopNode::publishWorlds() {
  WorldsInMap& out = worlds.draft();
  out.newest = stage_.correction();
  out.keyframes.clear();
  stage_.tiedEpochs(out.newest.epoch, out.tied);
  for (std::size_t i = 0; i < stage_.nodeCount(); ++i) {
    const MapNode node = stage_.node(i);
    if (node.epoch != out.newest.epoch) continue;
    static_cast<void>(out.keyframes.tryPushBack({node.frame, node.T_map_body * node.T_world_body.inverse()}));
  }
  worlds.send();
}

}  // namespace swiftlet
