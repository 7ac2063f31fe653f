#include "estimator/smoother/window_covariance.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Scales the sigmas of the pose; correlations do not change.
void scalePose(double factor, Matrix15d& covariance) {
  const double sigmas = std::sqrt(factor);
  covariance.topRows<kPoseDim>() *= sigmas;
  covariance.leftCols<kPoseDim>() *= sigmas;
}

}  // namespace

WindowCovariance::WindowCovariance()
    : factor_(alignedMapSize(kMaxSystemDim)),
      columns_i_(static_cast<std::size_t>(kMaxSystemDim) * kStateDim),
      columns_j_(static_cast<std::size_t>(kMaxSystemDim) * kStateDim) {}

void WindowCovariance::take(NormalEquations& system, WindowProblem& problem) {
  system.swapMatrix(factor_);
  dimension_ = problem.dimension;
  for (const std::uint8_t slot : problem.window.order()) {
    WindowState& state = problem.window.inSlot(slot);
    state.factor_offset = state.offset;
    state.factor_dimension = state.dimension();
  }
  for (ExtraState& extra : problem.extras.states()) {
    extra.factor_offset = extra.kind == ExtraKind::kNone ? -1 : extra.offset;
  }
  // The newest state has the last columns, so its marginal follows from the factor's last diagonal block.
  const MatrixMap L = factor();
  const int at = problem.window.newest().offset;
  Matrix15d corner = Matrix15d::Zero();
  for (int c = 0; c < kStateDim; ++c) {
    for (int r = c; r < kStateDim; ++r) corner(r, c) = L(at + r, at + c);
  }
  const Matrix15d inverse = corner.triangularView<Eigen::Lower>().solve(Matrix15d::Identity());
  newest_ = inverse.transpose() * inverse;
  scalePose(factor_of_poses_, newest_);
}

void WindowCovariance::solveColumns(int offset, int count, std::vector<double>& columns) {
  const MatrixMap L = factor();
  for (int c = 0; c < count; ++c) {
    VectorMap column(columns.data() + static_cast<std::ptrdiff_t>(c) * dimension_, dimension_);
    column.setZero();
    column[offset + c] = 1.0;
    choleskyForward(L, column, offset + c);
  }
}

bool WindowCovariance::relative(const WindowState& a, const WindowState& b,
                                Eigen::Matrix<double, 6, 6>& covariance) {
  if (a.factor_offset < 0 || b.factor_offset < 0 || dimension_ == 0) return false;
  solveColumns(a.factor_offset, kPoseDim, columns_i_);
  solveColumns(b.factor_offset, kPoseDim, columns_j_);
  using Columns = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, kPoseDim>>;
  const Columns Y_a(columns_i_.data(), dimension_, kPoseDim);
  const Columns Y_b(columns_j_.data(), dimension_, kPoseDim);
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
  covariance = factor_of_poses_ * J * joint * J.transpose();
  return true;
}

bool WindowCovariance::calibration(int dimension, CalibrationMatrix& covariance) {
  if (dimension == 0 || dimension_ == 0) return false;
  solveColumns(0, dimension, columns_i_);
  const Eigen::Map<
      const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSystemDim, kMaxCalibrationDim>>
      Y(columns_i_.data(), dimension_, dimension);
  covariance = factor_of_poses_ * Y.transpose() * Y;
  return true;
}

Eigen::Matrix3d WindowCovariance::of(const ExtraState& extra) {
  if (extra.factor_offset < 0) return Eigen::Matrix3d::Zero();
  solveColumns(extra.factor_offset, kExtraDim, columns_i_);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, kExtraDim>> Y(columns_i_.data(), dimension_,
                                                                             kExtraDim);
  Eigen::Matrix3d covariance;
  covariance.noalias() = factor_of_poses_ * Y.transpose() * Y;
  return covariance;
}

KeyframeState WindowCovariance::record(const WindowState& state) {
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
  const int count = state.factor_dimension;
  const int rest = kStateDim - count;
  keyframe.state.covariance.topRightCorner(count, rest).setZero();
  keyframe.state.covariance.bottomLeftCorner(rest, count).setZero();
  solveColumns(state.factor_offset, count, columns_i_);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSystemDim, kStateDim>>
      Y(columns_i_.data(), dimension_, count);
  keyframe.state.covariance.topLeftCorner(count, count) = Y.transpose() * Y;
  scalePose(factor_of_poses_, keyframe.state.covariance);
  return keyframe;
}

}  // namespace swiftlet
