#include "firmware_host/graph/loop_node.hpp"

#include <algorithm>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

/// The flight's limits, with additional room for a kept map.
LoopLimits limitsBeside(const KeptGraph* kept) {
  LoopLimits limits;
  if (kept == nullptr) return limits;
  limits.nodes += kept->nodes.size();
  limits.loops += kept->loops.size();
  return limits;
}

WorldInMap worldOf(const LoopStage& stage, std::size_t i) {
  const MapNode node = stage.node(i);
  return {node.frame, node.epoch, node.T_map_body, node.T_world_body};
}

}  // namespace

LoopNode::LoopNode(GraphContext& context)
    : Node("loop", Rank::kLow),
      context_(context),
      view_(imageFeedOf(context.options.outlets)),
      stage_(context.rig, context.settings.loop_stage, limitsBeside(context.options.kept_map),
             context.options.vocabulary != nullptr ? *context.options.vocabulary : Vocabulary::shipped()) {
  if (context.options.kept_map == nullptr) return;
  const KeptUse use = context.settings.loop.extend_map ? KeptUse::kExtend : KeptUse::kLocalize;
  const Status status = stage_.takeIn(*context.options.kept_map, use);
  if (status.ok()) return;
  throw InputError(context.settings.loop.in_map, 0, "", status.what, "Choose another kept map");
}

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
    if (worlds.connected()) {
      listWorlds(stage_, worlds.draft());
      worlds.send();
    }
    for (LiveOutlet* outlet : context_.options.outlets) outlet->correction.write(stage_.correction());
    reports.send();
  });
  if (view_ != nullptr && view_->wanted.load(std::memory_order_relaxed)) sendLoop(message.tracked.stamp);
  context_.count(StageId::kLoop, spent);
  steps.send(taken);
}

void LoopNode::sendLoop(Stamp keyframe) {
  const std::uint32_t count = stage_.loopCount();
  for (std::uint32_t i = shown_loops_; i < count; ++i) {
    if (stage_.loop(i).new_stamp != keyframe || !stage_.revisit(i, revisit_)) continue;
    LoopNews& out = view_->loop.draft();
    out.stamp = keyframe;
    out.old_stamp = revisit_.old_stamp;
    out.inliers = revisit_.matches.size();
    out.matches.clear();
    for (const RevisitMatch& match : revisit_.matches) {
      if (!out.matches.tryPushBack({match.new_feature.pixel[0], match.old_feature.pixel[0]})) break;
    }
    view_->loop.publish();
    break;
  }
  shown_loops_ = count;
}

std::vector<WorldInMap> LoopNode::keptNodes() const {
  std::vector<WorldInMap> nodes;
  for (std::size_t i = 0; i < stage_.keptCount(); ++i) nodes.push_back(worldOf(stage_, i));
  return nodes;
}

void listWorlds(const LoopStage& stage, WorldsInMap& out) {
  out.newest = stage.correction();
  out.keyframes.clear();
  stage.tiedEpochs(out.newest.epoch, out.tied);
  const auto isListed = [&](std::size_t i) {
    const std::uint32_t epoch = stage.node(i).epoch;
    return epoch == out.newest.epoch || std::ranges::find(out.tied, epoch) != out.tied.end();
  };
  const std::size_t kept = stage.keptCount(), kept_step = kept / WorldsInMap::kMostKept + 1;
  std::size_t room = out.keyframes.capacity(), flown = 0;
  for (std::size_t i = 0; i < kept; i += kept_step) room -= isListed(i) ? 1 : 0;
  for (std::size_t i = kept; i < stage.nodeCount(); ++i) flown += isListed(i) ? 1 : 0;
  // The flight's nodes may exceed the room that the kept map's nodes leave: take every `step`-th.
  const std::size_t step = (flown + room - 1) / room;
  for (std::size_t i = kept; i < stage.nodeCount(); ++i) {
    if (isListed(i) && --flown % step == 0) static_cast<void>(out.keyframes.tryPushBack(worldOf(stage, i)));
  }
  for (std::size_t i = 0; i < kept; i += kept_step) {
    if (isListed(i)) static_cast<void>(out.keyframes.tryPushBack(worldOf(stage, i)));
  }
}

}  // namespace swiftlet
