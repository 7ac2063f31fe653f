#include "firmware_host/graph/smooth_node.hpp"

namespace swiftlet {

SmoothNode::SmoothNode(GraphContext& context)
    : Node("smooth", Rank::kSmooth),
      context_(context),
      full_effort_(context.settings.effort),
      effort_(context.options.smooth_effort != nullptr ? context.options.smooth_effort : &full_effort_),
      view_(imageFeedOf(context.options.outlets)),
      stage_(context.rig, context.noise, context.settings.odometry) {}

bool SmoothNode::turn() {
  const bool ended = inputEnded();
  const TrackMessage* message = tracked.front();
  if (message != nullptr) {
    take(*message);
    tracked.pop();
    return true;
  }
  samples.takeSurplus(stage_);
  if (ended && !done()) end();
  return false;
}

void SmoothNode::take(const TrackMessage& message) {
  FrameResult& out = results.draft();
  out.kind = message.kind;
  out.track_status = message.status;
  out.status = okStatus();
  out.track_step = message.step;
  out.host = message.host;
  out.spent = message.spent;
  out.dropped = message.dropped;
  out.track_level = message.effort_level;
  const bool tracked_frame = message.kind == TrackMessage::Kind::kFrame;
  if (tracked_frame) smoothFrame(message, out);
  out.published = wallSeconds();
  results.send();
  if (!tracked_frame) return;
  context_.count(StageId::kTrim, measured([&] { stage_.trim(); }), message.tracked.keyframe);
  publishWindow(message);
}

void SmoothNode::smoothFrame(const TrackMessage& message, FrameResult& out) {
  const double begin = wallSeconds();
  out.step.frame = message.tracked.index;
  out.step.effort = effort_->give();
  out.smooth_level = effort_->level();
  const Spent spent = context_.timed(StageId::kSmooth, [&] {
    samples.takeUntil(message.tracked.stamp + context_.rig.sampleLead(), message.tracked.timeline, stage_);
    out.step.samples = samples.taken();
    out.step.planes = planes.refresh();
    if (out.step.planes != planes_) {
      planes_ = out.step.planes;
      stage_.take(planes.value());
    }
    out.status = stage_.step(message.tracked, out.step.effort, out.output);
    stage_.fix(fix.draft());
    fix.send();
    for (LiveOutlet* outlet : context_.options.outlets) {
      const OdometryOutput& output = out.output;
      outlet->frame.write({message.tracked.stamp, output.has_state, output.waiting_for, output.state.health,
                           output.state.epoch, output.statistics, wallSeconds() - message.host.arrival});
    }
  });
  effort_->took({spent.wall, static_cast<int>(tracked.size()) - 1, begin - message.ready});
  out.tracked = message.tracked;
  out.spent += spent;
  const NavState& state = out.output.state;
  frame_ = {frame_.count + 1, message.tracked.stamp, out.output.has_state, state.health,
            state.epoch,      out.track_level,       out.smooth_level};
  Eigen::Map<Eigen::Vector3d>(frame_.world_up.data()) = state.T_world_body.R().row(2).transpose();
  newest_frame_.write(frame_);
  context_.count(StageId::kSmooth, spent, message.tracked.keyframe);
  steps.send(out.step);
}

void SmoothNode::publishWindow(const TrackMessage& message) {
  SmoothedWindow& smoothed = window.draft();
  stage_.window(smoothed);
  if (mesh.connected()) {
    MeshMessage& to_mesh = mesh.draft();
    to_mesh.window = smoothed;
    to_mesh.tracked = message.tracked;
    to_mesh.image = message.step.image[0];
    mesh.send();
  }
  ++windows_;  // this one is about to be sent
  if (keyframes.connected() && message.tracked.keyframe && smoothed.started) sendKeyframe(message, smoothed);
  if (mapped.connected() && message.mapped && smoothed.started) sendMapped(message, smoothed);
  if (view_ != nullptr && view_->wanted.load(std::memory_order_relaxed) && shown_.take(message.tracked.stamp))
    sendSight(message, smoothed);
  window.send();
}

void SmoothNode::sendSight(const TrackMessage& message, const SmoothedWindow& smoothed) {
  SightNews& out = view_->sight.draft();
  out.stamp = message.tracked.stamp;
  out.frame = message.tracked.index;
  out.keyframe = message.tracked.keyframe;
  out.image = message.step.image;
  out.features = message.tracked.features;
  out.lost = message.lost;
  out.has_pose = smoothed.started && !smoothed.poses.empty();
  out.landmarks.clear();
  if (out.has_pose) {
    for (const WindowLandmark& landmark : smoothed.landmarks) out.landmarks.pushBack(landmark.id);
  }
  out.epoch = smoothed.epoch;
  for (std::size_t c = 0; out.has_pose && c < kMaxCameras; ++c) {
    out.T_world_cam[c] = smoothed.poses.back().T_world_body * smoothed.calibration.T_body_cam[c];
  }
  view_->sight.publish();
}

void SmoothNode::sendKeyframe(const TrackMessage& message, const SmoothedWindow& smoothed) {
  KeyframeMessage& out = keyframes.draft();
  out.window = smoothed;
  out.window_number = windows_;
  out.tracked = message.tracked;
  out.image = message.step.image;
  stage_.link(out.window, out.link);
  keyframes.send();
}

void SmoothNode::sendMapped(const TrackMessage& message, const SmoothedWindow& smoothed) {
  const Health health = smoothed.newest.health;
  // Nothing is mapped while the pose is unreliable or still initializing.
  if (smoothed.poses.empty() || (health != Health::kGood && health != Health::kDegraded)) return;
  MapMessage& out = mapped.draft();
  out.frame = message.tracked.index;
  out.stamp = message.tracked.stamp;
  out.epoch = smoothed.epoch;
  out.pose = smoothed.poses.back();
  mapped.send();
}

SmoothedFrameNews SmoothNode::newestFrame() const {
  SmoothedFrameNews frame;
  static_cast<void>(newest_frame_.read(frame));
  return frame;
}

/// The last result holds the remaining output, so it waits for room unless all readers have ended.
void SmoothNode::end() {
  if (!results.hasRoom() && !results.readersDone()) return;
  FrameResult& out = results.draft();
  out.kind = TrackMessage::Kind::kEnd;
  out.track_status = out.status = okStatus();
  out.track_step = TrackStep{};
  out.track_step.stamp = kEndOfTime;
  out.dropped = 0;
  out.output = OdometryOutput{};
  stage_.finish(out.output);
  out.published = wallSeconds();
  results.send();
  finish();
}

}  // namespace swiftlet
