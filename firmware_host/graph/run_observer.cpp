#include "firmware_host/graph/run_observer.hpp"

#include <fmt/format.h>

namespace swiftlet {

void RunObserver::onResult(const FrameResult& result) {
  const Stamp stamp = result.track_step.stamp;
  if (result.dropped > 0) {
    listener_.onRemark(
        stamp, fmt::format("{} frame(s) before this one dropped: tracking is overloaded", result.dropped));
  }
  switch (result.kind) {
    case TrackMessage::Kind::kFrame:
      noteFrame(result);
      break;
    case TrackMessage::Kind::kFrameRefused:
      ++statistics_.frames;
      ++statistics_.frames_refused;
      ++statistics_.faults[result.track_status.what];
      listener_.onRemark(stamp, std::string("frame rejected: ") + result.track_status.what);
      break;
    case TrackMessage::Kind::kImageRefused:
      listener_.onRemark(stamp, std::string("image rejected: ") + result.track_status.what);
      break;
    case TrackMessage::Kind::kEnd:
      noteEvents(result.output);
      listener_.onFinish(result.output);
      break;
  }
}

void RunObserver::restart(std::uint32_t timeline, Stamp /*first*/) {
  timeline_ = timeline;
  keeper_->restart();
  ++statistics_.faults["stamps went backwards: earlier keyframes are removed from the map"];
}

void RunObserver::onLoop(const LoopReport& report) {
  for (const LoopCandidate& candidate : report.candidates) {
    const double ago = (candidate.new_stamp - candidate.old_stamp).seconds();
    listener_.onRemark(report.stamp,
                       fmt::format("loop candidate {} ({}): {}; {} matches, {} features fit a relative pose",
                                   candidate.kept ? "in the kept map" : fmt::format("{:.1f} s ago", ago),
                                   candidate.near ? "by position" : "by appearance", describe(candidate.fate),
                                   candidate.matches, candidate.inliers));
  }
  if (statistics_.located) noteLocated(report);
  listener_.onLoop(report);
  if (!report.moved) return;
  const Eigen::Vector3d& p = report.correction.T_map_world.translation;
  listener_.onRemark(report.stamp,
                     fmt::format("map moved: {} of {} loops selected, T_map_world {:.3f} {:.3f} {:.3f} m",
                                 report.selected, report.loops, p.x(), p.y(), p.z()));
}

void RunObserver::noteLocated(const LoopReport& report) {
  LocatedStatistics& located = *statistics_.located;
  const bool now = report.correction.located;
  located.keyframes += now ? 1 : 0;
  if (now == located.now) return;
  located.now = now;
  located.taken_back += now ? 0 : 1;
  if (now && !located.first) located.first = report.stamp;
  listener_.onRemark(report.stamp, now ? "located in the kept map" : "no longer located in the kept map");
}

void RunObserver::keepLoops(LoopStage& loops) {
  listener_.onPlaces(loops);
  statistics_.loop = loops.counters();
  for (std::size_t i = loops.keptCount(); i < loops.nodeCount(); ++i) {
    const MapNode node = loops.node(i);
    nodes_.push_back({node.stamp, node.T_map_body});
  }
  for (std::uint32_t i = 0; i < loops.loopCount(); ++i) {
    const MapLoop loop = loops.loop(i);
    if (!loop.kept) loops_.push_back(loop);
    LoopRevisit revisit;
    if (keeper_ && loops.revisit(i, revisit)) keeper_->addRevisit(revisit);
  }
}

void RunObserver::noteFrame(const FrameResult& result) {
  const TrackedFrame& tracked = result.tracked;
  const OdometryOutput& output = result.output;
  ++statistics_.frames;
  if (!statistics_.first_image) statistics_.first_image = tracked.stamp;
  statistics_.last_image = tracked.stamp;
  if (!result.status.ok() && result.status.code != StatusCode::kNotReady) {
    ++statistics_.smooth_faults;
    ++statistics_.faults[result.status.what];
  }
  if (tracked.keyframe) ++statistics_.keyframes;
  addTime(statistics_.times, StageId::kImageToPose,
          {result.published - result.host.arrival, result.spent.cpu}, tracked.keyframe);
  addTime(statistics_.times, StageId::kExposureToPose,
          {result.published - result.host.exposure, result.spent.cpu}, tracked.keyframe);
  noteEvents(output);
  noteHealth(tracked.stamp, output);
  statistics_.verdict.add(tracked.stamp, output);
  noteEffort("track", result, result.track_step.effort, track_effort_);
  noteEffort("smooth", result, result.step.effort, smooth_effort_);
  any_frame_ = true;
  const bool kept = tracked.keyframe && output.has_state && tracked.timeline == timeline_;
  if (keeper_ && kept) {
    keeper_->addCalibration(output.calibration);
    keeper_->addKeyframe(tracked, output.state, output.statistics.noise);
  }
  listener_.onFrame(tracked, output);
}

void RunObserver::noteEvents(const OdometryOutput& output) {
  for (const Event& event : output.events) {
    EventTotal& total = statistics_.events[event.kind];
    ++total.count;
    total.value += event.value;
  }
}

void RunObserver::noteEffort(const char* stage, const FrameResult& result, const Effort& now, Effort& last) {
  if (any_frame_ && !(now == last)) {
    ++statistics_.effort_changes;
    listener_.onRemark(result.track_step.stamp,
                       fmt::format("effort of {} is now {} iterations, {} features, {} keyframes", stage,
                                   now.iterations, now.features, now.keyframes));
  }
  last = now;
}

void RunObserver::noteHealth(Stamp stamp, const OdometryOutput& output) {
  if (output.has_state) {
    if (!statistics_.first_pose) statistics_.first_pose = stamp;
    ++statistics_.poses;
  } else if (*output.waiting_for != '\0' && waiting_for_ != output.waiting_for) {
    waiting_for_ = output.waiting_for;
    listener_.onRemark(stamp, "no pose yet: waiting for " + waiting_for_);
  }
  if (statistics_.first_pose) ++statistics_.frames_since_first_pose;
  const HealthChange now{stamp, output.state.health, output.state.epoch};
  if (statistics_.health.empty() || statistics_.health.back().health != now.health ||
      statistics_.health.back().epoch != now.epoch) {
    statistics_.health.push_back(now);
  }
}

}  // namespace swiftlet
