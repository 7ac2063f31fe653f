#include "estimator/smoother/normal_equations.hpp"

#include <algorithm>
#include <span>

#include "estimator/smoother/landmark_block.hpp"

namespace swiftlet {

NormalEquations::NormalEquations()
    : h_(alignedMapSize(kMaxSystemDim)),
      g_(kMaxSystemDim),
      landmark_(std::make_unique<LandmarkBlock>(kMaxStates)),
      blocks_(kMaxStates * kMaxStates) {}

NormalEquations::~NormalEquations() = default;

void NormalEquations::begin(const CalibrationLayout& calibration, int dimension) {
  calibration_ = calibration;
  dimension_ = dimension;
  cost_ = 0;
  MatrixMap h = H();
  for (int c = 0; c < dimension; ++c) h.col(c).tail(dimension - c).setZero();
  g().setZero();
  // Clear only the blocks used by the last system.
  for (std::size_t i = 0; i < kMaxStates; ++i) {
    if (!touched_[i]) continue;
    for (std::size_t j = 0; j < kMaxStates; ++j) {
      if (touched_[j]) block(i, j) = PaddedBlock{};
    }
  }
  for (auto& gradient : pose_gradient_) gradient.fill(0.0);
  touched_.fill(false);
}

MatrixMap NormalEquations::H() { return alignedMap(h_, dimension_); }

VectorMap NormalEquations::g() { return {g_.data(), dimension_}; }

void NormalEquations::addMotion(const MotionFactor& factor, const WindowState& i, const WindowState& j,
                                int gyro_offset) {
  MatrixMap h = H();
  VectorMap gradient = g();
  h.block<15, 15>(i.offset, i.offset) += factor.jacobian_i.transpose() * factor.jacobian_i;
  h.block<15, 15>(j.offset, j.offset) += factor.jacobian_j.transpose() * factor.jacobian_j;
  if (j.offset > i.offset) {
    h.block<15, 15>(j.offset, i.offset) += factor.jacobian_j.transpose() * factor.jacobian_i;
  } else {
    h.block<15, 15>(i.offset, j.offset) += factor.jacobian_i.transpose() * factor.jacobian_j;
  }
  gradient.segment<15>(i.offset) += factor.jacobian_i.transpose() * factor.residual;
  gradient.segment<15>(j.offset) += factor.jacobian_j.transpose() * factor.residual;
  cost_ += 0.5 * factor.residual.squaredNorm();
  if (!factor.with_gyro) return;
  const auto& J = factor.jacobian_gyro_matrix;
  h.block<kGyroMatrixDim, kGyroMatrixDim>(gyro_offset, gyro_offset) += J.transpose() * J;
  h.block<15, kGyroMatrixDim>(i.offset, gyro_offset) += factor.jacobian_i.topRows<9>().transpose() * J;
  h.block<15, kGyroMatrixDim>(j.offset, gyro_offset) += factor.jacobian_j.topRows<9>().transpose() * J;
  gradient.segment<kGyroMatrixDim>(gyro_offset) += J.transpose() * factor.residual.head<9>();
}

void NormalEquations::addDiagonal(const WindowState& state, int first, const Eigen::Vector3d& residual,
                                  double sigma) {
  const double information = 1.0 / (sigma * sigma);
  const int at = state.offset + first;
  for (int k = 0; k < 3; ++k) H()(at + k, at + k) += information;
  g().segment<3>(at) += information * residual;
  cost_ += 0.5 * information * residual.squaredNorm();
}

void NormalEquations::addFactor(const LinearFactor& factor) {
  MatrixMap h = H();
  VectorMap gradient = g();
  for (int a = 0; a < factor.columns; ++a) {
    const int column_a = factor.column[static_cast<std::size_t>(a)];
    const Eigen::Vector3d J_a = factor.jacobian.col(a);
    gradient[column_a] += J_a.dot(factor.residual);
    for (int b = 0; b <= a; ++b) {
      const int column_b = factor.column[static_cast<std::size_t>(b)];
      h(std::max(column_a, column_b), std::min(column_a, column_b)) += J_a.dot(factor.jacobian.col(b));
    }
  }
  cost_ += factor.cost;
}

bool NormalEquations::addLandmark(const LandmarkViews& views, const LandmarkPoint& point,
                                  const std::array<WindowState, kMaxStates>& states,
                                  EliminatedPoint* eliminated) {
  landmark_->linearize(views, point);
  if (!landmark_->eliminate()) return false;
  if (eliminated != nullptr) eliminated->keep(*landmark_);
  addStates(states);
  // The only part that is quadratic in the states. Each pair occurs in both orders; the one below the
  // diagonal is used.
  const std::span<const LandmarkBlock::State> seen = landmark_->states();
  for (const LandmarkBlock::State& i : seen) {
    const PairProduct product(i);
    for (const LandmarkBlock::State& j : seen) {
      if (&i == &j || states[i.slot].offset < states[j.slot].offset) continue;
      product.subtract(j, block(i.slot, j.slot));
    }
  }
  return true;
}

void NormalEquations::addExplicitLandmark(const LandmarkViews& views, const Eigen::Vector3d& position,
                                          int offset, const std::array<WindowState, kMaxStates>& states) {
  landmark_->linearize(views, position);
  landmark_->keepPoint();
  addStates(states);
  MatrixMap h = H();
  h.block<3, 3>(offset, offset) += landmark_->pointInformation();
  g().segment<3>(offset) += landmark_->pointGradient();
  const int dimension = calibration_.dimension();
  h.block(offset, 0, 3, dimension) += landmark_->calibration().point.topRows(dimension).transpose();
  for (const LandmarkBlock::State& state : landmark_->states()) {
    using Columns = Eigen::Matrix<double, kPaddedRows, 3>;
    h.block<kPoseDim, 3>(states[state.slot].offset, offset) +=
        Eigen::Map<const Columns>(state.point[0]).topRows<kPoseDim>();
  }
}

// Adds the terms of the current landmark in single states and in the calibration.
void NormalEquations::addStates(const std::array<WindowState, kMaxStates>& states) {
  cost_ += landmark_->cost();
  for (const LandmarkBlock::State& state : landmark_->states()) {
    touched_[state.slot] = true;
    block(state.slot, state.slot).add(state.information);
    auto& gradient = pose_gradient_[state.slot];
    for (std::size_t i = 0; i < kPoseDim; ++i) gradient[i] += state.gradient[i];
  }
  const int dimension = calibration_.dimension();
  if (dimension == 0) return;
  MatrixMap h = H();
  const LandmarkBlock::Calibration& calibration = landmark_->calibration();
  h.topLeftCorner(dimension, dimension) += calibration.information.topLeftCorner(dimension, dimension);
  g().head(dimension) += calibration.gradient.head(dimension);
  for (std::size_t k = 0; k < landmark_->states().size(); ++k) {
    h.block(states[landmark_->states()[k].slot].offset, 0, kPoseDim, dimension) +=
        landmark_->cross(k).leftCols(dimension);
  }
}

void NormalEquations::finish(const std::array<WindowState, kMaxStates>& states) {
  MatrixMap h = H();
  VectorMap gradient = g();
  for (std::uint8_t i = 0; i < kMaxStates; ++i) {
    if (!touched_[i]) continue;
    const int at_i = states[i].offset;
    for (int row = 0; row < kPoseDim; ++row) {
      gradient[at_i + row] += pose_gradient_[i][static_cast<std::size_t>(row)];
    }
    for (std::uint8_t j = 0; j < kMaxStates; ++j) {
      if (!touched_[j] || states[j].offset > at_i) continue;
      const PaddedBlock& source = block(i, j);
      for (int column = 0; column < kPoseDim; ++column) {
        for (int row = 0; row < kPoseDim; ++row) {
          h(at_i + row, states[j].offset + column) += source.column[column][row];
        }
      }
    }
  }
}

}  // namespace swiftlet
