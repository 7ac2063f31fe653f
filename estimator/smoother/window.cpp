#include "estimator/smoother/window.hpp"

namespace swiftlet {

void Window::clear() {
  order_.clear();
  for (WindowState& state : states_) state.used = false;
}

std::uint8_t Window::add() {
  std::uint8_t slot = 0;
  while (states_[slot].used) ++slot;
  states_[slot] = WindowState{};
  states_[slot].used = true;
  order_.pushBack(slot);
  return slot;
}

void Window::remove(std::size_t position) {
  states_[order_[position]].used = false;
  order_.erase(position);
}

std::size_t Window::motionBegin() const {
  std::size_t k = 0;
  while (k < order_.size() && !(*this)[k].has_motion) ++k;
  return k;
}

int Window::assignOffsets(int first) {
  for (const std::uint8_t slot : order_) {
    states_[slot].offset = first;
    first += states_[slot].dimension();
  }
  return first;
}

void Window::retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
  for (const std::uint8_t slot : order_) {
    Vector15d delta = Vector15d::Zero();
    delta.head(states_[slot].dimension()) = step.segment(states_[slot].offset, states_[slot].dimension());
    states_[slot].x.retract(delta);
  }
}

void Window::backup() {
  for (const std::uint8_t slot : order_) backup_[slot] = states_[slot].x;
}

void Window::restore() {
  for (const std::uint8_t slot : order_) states_[slot].x = backup_[slot];
}

void Window::freeze(std::uint8_t slot) {
  WindowState& state = states_[slot];
  if (state.frozen) return;
  state.frozen = true;
  state.first_estimate = state.x;
  state.moved_estimate = state.x;
}

// First estimates keep what is known apart from what is not; but when the window as a whole has
// moved since (with one camera the scale, and so the place, is known to some per cent only), points
// and states that are not frozen have moved along, and Jacobians between old and new places are wrong
// by the parallax of that move. A common translation changes no factor and leaves the unobservable
// directions' span: the first estimates are moved with the window.
Eigen::Vector3d Window::moveEstimates() {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  int frozen = 0;
  for (const std::uint8_t slot : order_) {
    const WindowState& state = states_[slot];
    if (!state.frozen) continue;
    shift += state.x.T_world_body.translation - state.moved_estimate.T_world_body.translation;
    ++frozen;
  }
  if (frozen == 0) return shift;
  shift /= frozen;
  for (const std::uint8_t slot : order_) {
    if (states_[slot].frozen) states_[slot].moved_estimate.T_world_body.translation += shift;
  }
  return shift;
}

}  // namespace swiftlet
