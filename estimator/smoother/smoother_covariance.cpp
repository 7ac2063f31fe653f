// Covariances from the factor of the last solve, and the record of a keyframe that leaves.

#include <Eigen/Cholesky>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

// The factor outlives the system, which marginalization reuses.
void Smoother::keepFactor() {
  system_.swapMatrix(factor_);
  const MatrixMap L = alignedMap(factor_, dimension_);
  factor_dimension_ = dimension_;
  for (const std::uint8_t slot : order_) {
    states_[slot].factor_offset = states_[slot].offset;
    states_[slot].factor_dimension = states_[slot].dimension();
  }
  for (ExtraState& extra : extras_) extra.factor_offset = extra.kind == ExtraKind::kNone ? -1 : extra.offset;
  // The newest state is last: its marginal is the inverse of the factor's last diagonal block.
  const int at = states_[order_.back()].offset;
  Matrix15d corner = Matrix15d::Zero();
  for (int c = 0; c < kStateDim; ++c) {
    for (int r = c; r < kStateDim; ++r) corner(r, c) = L(at + r, at + c);
  }
  const Matrix15d inverse = corner.triangularView<Eigen::Lower>().solve(Matrix15d::Identity());
  covariance_ = inverse.transpose() * inverse;
}

void Smoother::solveFactorColumns(int offset, int count, std::vector<double>& columns) {
  const MatrixMap L = alignedMap(factor_, factor_dimension_);
  for (int c = 0; c < count; ++c) {
    VectorMap column(columns.data() + static_cast<std::ptrdiff_t>(c) * factor_dimension_, factor_dimension_);
    column.setZero();
    column[offset + c] = 1.0;
    choleskyForward(L, column, offset + c);
  }
}

bool Smoother::relativeCovariance(std::size_t i, std::size_t j, Eigen::Matrix<double, 6, 6>& covariance) {
  const WindowState& a = states_[order_[i]];
  const WindowState& b = states_[order_[j]];
  if (a.factor_offset < 0 || b.factor_offset < 0 || factor_dimension_ == 0) return false;
  solveFactorColumns(a.factor_offset, kPoseDim, columns_i_);
  solveFactorColumns(b.factor_offset, kPoseDim, columns_j_);
  using Columns = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, kPoseDim>>;
  const Columns Y_a(columns_i_.data(), factor_dimension_, kPoseDim);
  const Columns Y_b(columns_j_.data(), factor_dimension_, kPoseDim);
  Eigen::Matrix<double, 12, 12> joint;
  joint.topLeftCorner<6, 6>().noalias() = Y_a.transpose() * Y_a;
  joint.bottomRightCorner<6, 6>().noalias() = Y_b.transpose() * Y_b;
  joint.topRightCorner<6, 6>().noalias() = Y_a.transpose() * Y_b;
  joint.bottomLeftCorner<6, 6>() = joint.topRightCorner<6, 6>().transpose();

  // T_i_j: R = R_i^T R_j, p = R_i^T (p_j - p_i).
  const Eigen::Matrix3d R_i_t = a.x.T_world_body.R().transpose();
  const Eigen::Matrix3d R_i_j = R_i_t * b.x.T_world_body.R();
  const Eigen::Vector3d p_i_j = R_i_t * (b.x.T_world_body.translation - a.x.T_world_body.translation);
  Eigen::Matrix<double, 6, 12> J = Eigen::Matrix<double, 6, 12>::Zero();
  J.block<3, 3>(0, 0) = -R_i_j.transpose();
  J.block<3, 3>(0, 6) = Eigen::Matrix3d::Identity();
  J.block<3, 3>(3, 0) = hat(p_i_j);
  J.block<3, 3>(3, 3) = -R_i_t;
  J.block<3, 3>(3, 9) = R_i_t;
  covariance = J * joint * J.transpose();
  return true;
}

KeyframeState Smoother::record(const WindowState& state) {
  KeyframeState keyframe;
  keyframe.state.stamp = state.stamp - Duration::fromSeconds(state.time_offset);
  keyframe.state.health = state.health;
  keyframe.state.T_world_body = state.x.T_world_body;
  keyframe.state.v_world_body = state.x.v_world_body;
  keyframe.state.bias_gyro = state.x.bias_gyro;
  keyframe.state.bias_accel = state.x.bias_accel;
  keyframe.state.covariance = state.covariance;
  keyframe.statistics = state.statistics;
  if (state.factor_offset < 0) return keyframe;
  // Velocity and biases of a pose-only keyframe keep the covariance they had when they left; their
  // correlation with the pose, which has been refined since, is not known any more.
  const int count = state.factor_dimension;
  const int rest = kStateDim - count;
  keyframe.state.covariance.topRightCorner(count, rest).setZero();
  keyframe.state.covariance.bottomLeftCorner(rest, count).setZero();
  solveFactorColumns(state.factor_offset, count, columns_i_);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSystemDim, kStateDim>>
      Y(columns_i_.data(), factor_dimension_, count);
  keyframe.state.covariance.topLeftCorner(count, count) = Y.transpose() * Y;
  return keyframe;
}

void Smoother::flush(FixedVector<KeyframeState, kMaxStates>& left_window) {
  left_window.clear();
  for (const std::uint8_t slot : order_) {
    if (states_[slot].keyframe) static_cast<void>(left_window.tryPushBack(record(states_[slot])));
  }
}

}  // namespace swiftlet
