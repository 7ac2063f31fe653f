#include "estimator/smoother/eliminated_point.hpp"

#include <cmath>

#include "estimator/smoother/landmark_block.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {
namespace {

// Relative minimum of the point's information. A point without parallax is then eliminated as a direction:
// its depth column is weak, not singular.
constexpr double kPointDamping = 1e-9;

}  // namespace

bool PointFactor::compute(Eigen::Matrix3d C) {
  C(2, 2) += kInverseDepthInformation;
  C.diagonal() *= 1.0 + kPointDamping;
  if (!(C(0, 0) > 0)) return false;
  i00 = 1.0 / std::sqrt(C(0, 0));
  l10 = C(1, 0) * i00;
  l20 = C(2, 0) * i00;
  const double d11 = C(1, 1) - l10 * l10;
  if (!(d11 > 0)) return false;
  i11 = 1.0 / std::sqrt(d11);
  l21 = (C(2, 1) - l20 * l10) * i11;
  const double d22 = C(2, 2) - l20 * l20 - l21 * l21;
  if (!(d22 > 0)) return false;
  i22 = 1.0 / std::sqrt(d22);
  return true;
}

StepOfStates::StepOfStates(const VectorMap& dx, const std::array<WindowState, kMaxStates>& states,
                           int calibration) {
  for (std::size_t slot = 0; slot < kMaxStates; ++slot) {
    const int offset = states[slot].offset;
    if (offset < 0 || offset + kPoseDim > dx.size()) continue;
    for (int k = 0; k < kPoseDim; ++k)
      pose_[slot][static_cast<std::size_t>(k)] = static_cast<float>(dx[offset + k]);
  }
  for (int k = 0; k < calibration; ++k) calibration_[static_cast<std::size_t>(k)] = static_cast<float>(dx[k]);
}

void EliminatedPoint::keep(const LandmarkBlock& landmark) {
  L_ = landmark.factor();
  z_ = landmark.z();
  count_ = 0;
  for (const LandmarkBlock::State& state : landmark.states()) {
    StateColumns& columns = states_[count_++];
    columns.slot = state.slot;
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t r = 0; r < kPaddedRows; ++r) columns.Y[k][r] = static_cast<float>(state.point[k][r]);
    }
  }
  calibration_dimension_ = landmark.calibrationDimension();
  if (calibration_dimension_ > 0) Y_calibration_ = landmark.calibration().point.cast<float>();
}

Eigen::Vector3d EliminatedPoint::step(const StepOfStates& states) const {
  alignas(32) float lanes[3][kPaddedRows] = {};
  for (std::size_t s = 0; s < count_; ++s) {
    const std::array<float, kPaddedRows>& dx = states.pose_[states_[s].slot];
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t r = 0; r < kPaddedRows; ++r) lanes[k][r] += states_[s].Y[k][r] * dx[r];
    }
  }
  Eigen::Vector3f sum;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* const lane = lanes[k];
    sum[static_cast<Eigen::Index>(k)] =
        ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
  }
  for (int k = 0; k < calibration_dimension_; ++k) {
    sum += Y_calibration_.row(k).transpose() * states.calibration_[static_cast<std::size_t>(k)];
  }
  Eigen::Vector3d result = -(z_ + sum.cast<double>());
  L_.solveTransposed(result);
  return result;
}

}  // namespace swiftlet
