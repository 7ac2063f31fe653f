#include "estimator/smoother/window_trim.hpp"

#include "estimator/smoother/keyframe_choice.hpp"

namespace swiftlet {
namespace {

// Bias walk within one increment is not modelled, so merging must not create longer intervals.
constexpr double kLongestMergedInterval = 3.0;  // s
// Largest number of departures of each kind per step while the window shrinks, which bounds the time. Each
// new keyframe causes at most one of each kind, so two reduce the window.
constexpr int kMaxDropsOfAKind = 2;

}  // namespace

void WindowTrim::trim(const TrimLimits& limits, FixedVector<KeyframeState, kMaxStates>& left_window) {
  Window& window = problem_.window;
  if (window.size() > limits.recent) {
    problem_.oldest_recent_frame = window[window.size() - limits.recent].frame_index;
  }
  for (std::size_t k = 0; k + limits.recent < window.size();) {
    if (window[k].keyframe) {
      ++k;
    } else {
      dropFrame(k);
    }
  }
  const std::size_t motion_states = limits.recent + limits.motion_keyframes;
  const std::size_t pose_only = limits.keyframes - limits.motion_keyframes;
  const auto too_old = [&] {
    return window.size() > limits.recent &&
           (window.newest().stamp - window[0].stamp).seconds() > limits.horizon;
  };
  // Each round removes a part of a state, so there are at most two rounds per state.
  int motions_dropped = 0;
  int keyframes_dropped = 0;
  for (;;) {
    const std::size_t poses = window.motionBegin();
    if ((window.size() - poses > motion_states && motions_dropped < kMaxDropsOfAKind) ||
        (poses == 0 && too_old())) {
      dropMotion(poses);
      ++motions_dropped;
    } else if ((poses > pose_only && keyframes_dropped < kMaxDropsOfAKind) || too_old()) {
      const std::size_t k = too_old() ? 0 : chooseKeyframe(poses);
      left_window.pushBack(covariance_.record(window[k]));
      dropKeyframe(k);
      ++keyframes_dropped;
    } else {
      break;
    }
  }
  if (problem_.extras.release()) marginalization_.marginalize(problem_, system_, Departure{});
}

void WindowTrim::dropFrame(std::size_t position) {
  Window& window = problem_.window;
  WindowState& state = window[position];
  problem_.landmarks.removeSightingsOf(window.order()[position]);
  const bool linked = position > 0 && window[position - 1].has_motion && position + 1 < window.size();
  if (!linked || problem_.prior.touches(window.order()[position])) {
    marginalization_.marginalize(problem_, system_, {position, 0, kStateDim, true, false});
    window.remove(position);
    return;
  }
  WindowState& next = window[position + 1];
  const WindowState& previous = window[position - 1];
  next.link_duration += state.link_duration;
  if (state.link == LinkKind::kConstantVelocity) next.link = LinkKind::kConstantVelocity;
  window.remove(position);
  if (next.link == LinkKind::kImu) problem_.integrateLink(next, previous);
  if (next.link_duration > kLongestMergedInterval) next.keyframe = true;
}

void WindowTrim::dropMotion(std::size_t position) {
  WindowState& state = problem_.window[position];
  state.covariance = covariance_.record(state).state.covariance;
  marginalization_.marginalize(problem_, system_, {position, kPoseDim, kStateDim - kPoseDim, true, false});
  state.has_motion = false;
}

void WindowTrim::dropKeyframe(std::size_t position) {
  const std::uint8_t slot = problem_.window.order()[position];
  problem_.extras.markDepartures(slot, problem_.oldest_recent_frame);
  marginalization_.marginalize(problem_, system_, {position, 0, kPoseDim, false, true});
  problem_.landmarks.removeSightingsOf(slot);
  problem_.window.remove(position);
}

std::size_t WindowTrim::chooseKeyframe(std::size_t candidates) const {
  std::array<KeyframeInWindow, kMaxStates> by_slot;
  for (const Landmark& landmark : problem_.landmarks) {
    const bool lately = landmark.last_frame >= problem_.oldest_recent_frame;
    for (const Sighting& s : landmark.sightings) {
      ++by_slot[s.slot].seen;
      if (lately) ++by_slot[s.slot].shared;
    }
  }
  FixedVector<KeyframeInWindow, kMaxStates> window;
  for (const std::uint8_t slot : problem_.window.order()) {
    const WindowState& state = problem_.window.inSlot(slot);
    window.pushBack({state.x.T_world_body, state.keyframe, by_slot[slot].seen, by_slot[slot].shared});
  }
  return keyframeToDrop(window, candidates);
}

}  // namespace swiftlet
