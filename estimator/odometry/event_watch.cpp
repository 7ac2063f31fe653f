#include "estimator/odometry/event_watch.hpp"

namespace swiftlet {

void EventBuffer::raise(Stamp stamp, EventKind kind, double value) {
  if (events_.size() + 1 < events_.capacity()) {
    events_.pushBack({stamp, kind, value});
    return;
  }
  ++lost_;
  if (events_.full()) events_.popBack();
  events_.pushBack({stamp, EventKind::kCapacityReached, static_cast<double>(lost_)});
}

void EventBuffer::flush(OdometryOutput& output) {
  output.events = events_;
  events_.clear();
  lost_ = 0;
}

void EventBuffer::merge(EventKind kind) {
  std::size_t first = events_.size();
  for (std::size_t i = 0; i < events_.size();) {
    if (events_[i].kind != kind || first == events_.size()) {
      if (events_[i].kind == kind) first = i;
      ++i;
      continue;
    }
    events_[first].value += events_[i].value;
    events_.erase(i);
  }
}

void EventWatch::reset() {
  any_ = false;
  initialized_ = false;
  health_ = Health::kInitializing;
  doubt_ = Doubt::kNone;
}

void EventWatch::step(const Frame& frame, EventBuffer& events) {
  if (!any_) first_ = frame.stamp;
  any_ = true;
  if (frame.health != health_) {
    events.raise(frame.stamp, EventKind::kHealthChanged, static_cast<double>(frame.health));
  }
  watchDoubt(frame, events);
  health_ = frame.health;
  if (!initialized_ && frame.health != Health::kInitializing) {
    initialized_ = true;
    events.raise(frame.stamp, EventKind::kInitialized, (frame.stamp - first_).seconds());
  }
  if (frame.at_rest != at_rest_) {
    events.raise(frame.stamp, frame.at_rest ? EventKind::kRestStarted : EventKind::kRestEnded, 0);
  }
  at_rest_ = frame.at_rest;
  watchCameras(frame, events);
  good_age_ = frame.good_age;
  watchBlackout(frame.stamp, frame.seconds_without_image, events);
}

// Reports the reason with each change of health, and while health stays bad when the reason changes, but at
// most once per kPause.
void EventWatch::watchDoubt(const Frame& frame, EventBuffer& events) {
  if (frame.doubt == doubt_ || frame.doubt == Doubt::kSettling) return;
  constexpr Duration kPause = Duration::fromMilliseconds(1000);
  const bool pause_over = doubt_ == Doubt::kNone || frame.stamp - doubt_told_ >= kPause;
  if (frame.health == health_ && !pause_over) return;
  doubt_ = frame.doubt;
  doubt_told_ = frame.stamp;
  if (doubt_ != Doubt::kNone) events.raise(frame.stamp, EventKind::kDoubt, static_cast<double>(doubt_));
}

void EventWatch::watchCameras(const Frame& frame, EventBuffer& events) {
  for (std::size_t c = 0; c < frame.cameras; ++c) {
    if (!frame.camera_present[c]) {
      if (++missing_[c] == kLostAfter)
        events.raise(frame.stamp, EventKind::kCameraLost, static_cast<double>(c));
      continue;
    }
    if (missing_[c] >= kLostAfter) events.raise(frame.stamp, EventKind::kCameraBack, static_cast<double>(c));
    missing_[c] = 0;
  }
}

void EventWatch::watchBlackout(Stamp stamp, double seconds_without_image, EventBuffer& events) {
  const bool dark = seconds_without_image > good_age_;
  if (dark && !dark_) {
    dark_since_ = stamp - Duration::fromSeconds(seconds_without_image);
    events.raise(stamp, EventKind::kBlackoutStarted, seconds_without_image);
  }
  if (!dark && dark_) {
    events.raise(stamp, EventKind::kBlackoutEnded, (stamp - dark_since_).seconds());
  }
  dark_ = dark;
}

}  // namespace swiftlet
