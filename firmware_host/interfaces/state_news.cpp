#include "firmware_host/interfaces/state_news.hpp"

namespace swiftlet {

StateNews::StateNews(const NavState& state, const Eigen::Vector3d& omega_body)
    : stamp_(state.stamp),
      epoch_(state.epoch),
      health_(state.health),
      T_world_body_(state.T_world_body),
      v_world_body_(state.v_world_body),
      bias_gyro_(state.bias_gyro),
      bias_accel_(state.bias_accel),
      omega_body_(omega_body) {
  std::size_t next = 0;
  for (int column = 0; column < kTold; ++column) {
    for (int row = column; row < kTold; ++row) {
      covariance_[next++] = static_cast<float>(state.covariance(row, column));
    }
  }
}

NavState StateNews::state() const {
  NavState state;
  state.stamp = stamp_;
  state.epoch = epoch_;
  state.health = health_;
  state.T_world_body = T_world_body_;
  state.v_world_body = v_world_body_;
  state.bias_gyro = bias_gyro_;
  state.bias_accel = bias_accel_;
  std::size_t next = 0;
  for (int column = 0; column < kTold; ++column) {
    for (int row = column; row < kTold; ++row) {
      const auto value = static_cast<double>(covariance_[next++]);
      state.covariance(row, column) = value;
      state.covariance(column, row) = value;
    }
  }
  return state;
}

}  // namespace swiftlet
