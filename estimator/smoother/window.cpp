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

}  // namespace swiftlet
