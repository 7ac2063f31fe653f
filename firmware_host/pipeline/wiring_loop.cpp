// The thread `loop`: keyframes with their images, one after the other, and the map that they make.

#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

// smooth -> keyframe with its window and its link to the one before -> loop
void Wiring::handKeyframe(const TrackMessage& message) {
  KeyframeMessage* out = to_loop_->keyframes.beginPush();
  if (out == nullptr) return;  // counted by the ring
  out->window = window_.draft();
  out->window_number = smoothing_.windows + 1;  // about to be published
  out->tracked = message.tracked;
  out->image = message.step.image;
  smooth_.link(out->window, out->link);
  to_loop_->keyframes.commitPush();
}

// keyframe, images -> place recognition, verification, selection, pose graph -> correction, report
bool Wiring::loop() {
  const bool ended = smoothDone();
  const KeyframeMessage* message = to_loop_ ? to_loop_->keyframes.front() : nullptr;
  if (message == nullptr) {
    if (ended) {
      closing_.images.reset();
      loop_done_.store(true, std::memory_order_release);
    }
    return false;
  }
  LoopInput input;
  input.tracks = &message->tracked;
  input.window = &message->window;
  input.link = &message->link;
  LoopStep step{message->tracked.index, message->window_number, {}};
  if (findKeyframeImages(message->tracked.index)) {
    input.image = closing_.images->image;
    step.image = closing_.images->number;
  }
  const Spent spent = measured([&] {
    const double cpu = threadCpuSeconds();
    LoopReport* report = to_loop_->reports.beginPush();
    LoopReport& out = report != nullptr ? *report : closing_.unread;
    static_cast<void>(loop_->step(input, LoopEffort{}, out));
    if (to_map_) publishMap();
    for (LiveOutlet* outlet : outlets_) outlet->correction.write(loop_->correction());
    if (report != nullptr) to_loop_->reports.commitPush();
    if (drag_) drag_(StageId::kLoop, threadCpuSeconds() - cpu);
  });
  addTime(times_, StageId::kLoop, spent);
  if (to_recorder_) static_cast<void>(to_recorder_->loop.tryPush(step));
  to_loop_->keyframes.pop();
  return true;
}

// loop -> newest correction -> map
void Wiring::publishMap() {
  WorldsInMap& out = to_map_->correction.draft();
  out.newest = loop_->correction();
  out.keyframes.clear();
  loop_->tiedEpochs(out.newest.epoch, out.tied);
  for (std::size_t i = 0; i < loop_->nodeCount(); ++i) {
    const MapNode node = loop_->node(i);
    if (node.epoch != out.newest.epoch) continue;
    static_cast<void>(out.keyframes.tryPushBack({node.frame, node.T_map_body * node.T_world_body.inverse()}));
  }
  to_map_->correction.publish();
}

bool Wiring::findKeyframeImages(std::uint64_t frame) {
  return bringToHead(*keyframe_images_, kLoopReads, to_loop_->images, closing_.images, frame,
                     [](const KeyframeImages& images) { return images.frame; });
}

}  // namespace swiftlet
