#pragma once
// The body states of the window: slots, order in time, columns, and steps that can be undone.
//
// A state keeps its slot until it is removed; observations and prior refer to states by slot. At most
// kMaxStates. Memory: 84 kB. Cost: linear in the states.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

class Window {
 public:
  void clear();
  [[nodiscard]] bool empty() const { return order_.empty(); }
  [[nodiscard]] std::size_t size() const { return order_.size(); }

  /// Appends an empty state. The window must not be full.
  std::uint8_t add();
  void remove(std::size_t position);

  /// Slots in order of time.
  [[nodiscard]] std::span<const std::uint8_t> order() const { return {order_.data(), order_.size()}; }
  [[nodiscard]] const std::array<WindowState, kMaxStates>& slots() const { return states_; }
  [[nodiscard]] WindowState& inSlot(std::size_t slot) { return states_[slot]; }
  [[nodiscard]] const WindowState& inSlot(std::size_t slot) const { return states_[slot]; }
  /// The k-th state in order of time.
  [[nodiscard]] WindowState& operator[](std::size_t k) { return states_[order_[k]]; }
  [[nodiscard]] const WindowState& operator[](std::size_t k) const { return states_[order_[k]]; }
  [[nodiscard]] WindowState& newest() { return states_[order_.back()]; }
  [[nodiscard]] const WindowState& newest() const { return states_[order_.back()]; }
  [[nodiscard]] std::uint8_t newestSlot() const { return order_.back(); }

  /// Index of the first state with velocity and biases; size() if there is none.
  [[nodiscard]] std::size_t motionBegin() const;
  /// Assigns columns to the states, in order of time; returns the first one after them.
  int assignOffsets(int first);

  /// x <- x [+] step, in the states' columns.
  void retract(const Eigen::Ref<const Eigen::VectorXd>& step);
  void backup();
  void restore();

 private:
  std::array<WindowState, kMaxStates> states_;
  FixedVector<std::uint8_t, kMaxStates> order_;
  std::array<BodyState, kMaxStates> backup_;
};

}  // namespace swiftlet
