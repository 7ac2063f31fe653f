#include "firmware_host/graph/track_node.hpp"

#include "estimator/odometry/stamp_guard.hpp"
#include "firmware_host/graph/sensor_node.hpp"
#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet {

TrackNode::TrackNode(GraphContext& context, const SensorNode& sensors)
    : Node("track", Rank::kTrack),
      frames(*this, context, sensors),
      context_(context),
      full_effort_(context.settings.effort),
      effort_(context.options.track_effort != nullptr ? context.options.track_effort : &full_effort_),
      view_(imageFeedOf(context.options.outlets)),
      stage_(context.rig, context.noise, context.settings.odometry) {}

bool TrackNode::turn() {
  const bool ended = inputEnded();
  const bool images_came = frames.images[0].size() > 0 || frames.images[1].size() > 0;
  const auto pair = [&] {
    frames.takeArrivals([this](const FrameQueue::Refusal& refusal) { refuse(refusal); });
  };
  if (images_came) {
    context_.count(StageId::kPairing, measured(pair));
  } else {
    pair();
  }
  if (frames.front() == nullptr) {
    samples.takeSurplus(stage_);
    return ended && !done() && flushAndFinish();
  }
  if (frames.front()->timeline < samples.timeline()) {  // its samples were discarded
    frames.drop();
    return true;
  }
  // If `smooth` was abandoned, its queue stays full.
  if (!tracked.hasRoom() && !tracked.readersDone()) return false;
  if (!ended && frames.awaitsSamples()) return false;
  trackFrame();
  return true;
}

void TrackNode::trackFrame() {
  const StereoFrame frame = *frames.front();
  TrackMessage& message = tracked.draft();
  message.kind = TrackMessage::Kind::kFrame;
  message.host = frames.hostTimes();
  TrackStep& step = message.step;
  step.frame = frame.index;
  step.stamp = frame.stamp;
  step.image = frame.number;
  message.ready = frames.readySince();
  const double age = wallSeconds() - message.ready;
  step.effort = effort_->give();
  message.effort_level = effort_->level();
  message.spent = context_.timed(StageId::kTrack, [&] {
    step.window = window.refresh();
    if (step.window != window_) {
      window_ = step.window;
      stage_.take(window.value());
    }
    samples.takeUntil(frame.stamp + context_.rig.sampleLead(), frame.timeline, stage_);
    step.samples = samples.taken();
    message.status = stage_.step(frame, step.effort, message.tracked);
  });
  effort_->took({message.spent.wall, frames.backlog(), age});
  const bool ok = message.status.ok();
  const bool keyframe = ok && message.tracked.keyframe;
  if (!ok) message.kind = TrackMessage::Kind::kFrameRefused;
  message.lost.clear();
  if (ok && view_ != nullptr && view_->wanted.load(std::memory_order_relaxed)) message.lost = stage_.lost();
  message.dropped = static_cast<int>(frame.index - next_frame_);
  next_frame_ = frame.index + 1;
  context_.count(StageId::kTrack, message.spent, keyframe);
  steps.send(step);
  message.mapped = copies.send(frame, keyframe, wantsMap(frame, keyframe) && ok);
  tracked.send();
  frames.pop();
}

void TrackNode::refuse(const FrameQueue::Refusal& refusal) {
  if (!tracked.hasRoom()) return;
  TrackMessage& message = tracked.draft();
  message.kind = TrackMessage::Kind::kImageRefused;
  message.status = refusal.status;
  message.step = TrackStep{};
  message.step.stamp = refusal.stamp;
  message.dropped = 0;
  tracked.send();
}

bool TrackNode::flushAndFinish() {
  if (frames.flush()) return true;
  finish();
  return false;
}

/// With a depth sensor, frames that have a depth image are mapped; otherwise keyframes and labelled frames,
/// if they have both cameras' images.
bool TrackNode::wantsMap(const StereoFrame& frame, bool keyframe) {
  bool depth = false, labels = false;
  while (const SceneNote* note = scene_notes.front()) {
    // Notes far ahead are left over from before the stamps jumped back.
    if (note->stamp > frame.stamp && !isFarAhead(frame.stamp, note->stamp)) break;
    if (note->stamp == frame.stamp) {
      depth = note->depth;
      labels = note->labels;
    }
    scene_notes.pop();
  }
  if (context_.options.depth_sensor != nullptr) return depth;
  return (keyframe || labels) && frame.has(0) && frame.has(1);
}

bool TrackNode::takeTracks(const TrackedFrame& frame, std::uint32_t timeline) {
  if (!tracked.hasRoom()) return false;
  TrackMessage& message = tracked.draft();
  message = TrackMessage{};
  message.step.frame = frame.index;
  message.step.stamp = frame.stamp;
  message.tracked = frame;
  message.tracked.timeline = timeline;
  message.host.arrival = message.host.exposure = message.ready = wallSeconds();
  tracked.send();
  return true;
}

void TrackNode::report(RunStatistics& statistics) const {
  statistics.pairing = frames.pairing();
  statistics.frames_dropped = frames.counters().dropped;
}

void TrackNode::addLosses(std::map<std::string, std::uint64_t>& losses) const {
  Node::addLosses(losses);
  const FrameQueue::Counters& counters = frames.counters();
  if (counters.dropped > 0) losses["frames_dropped"] += counters.dropped;
  if (counters.without_samples > 0) losses["frames_without_samples"] += counters.without_samples;
}

}  // namespace swiftlet
