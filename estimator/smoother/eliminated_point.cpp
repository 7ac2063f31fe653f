#include "estimator/smoother/eliminated_point.hpp"

#include <cmath>

#include "estimator/smoother/landmark_block.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {
namespace {

// Relative floor on the point's information, so that a point without parallax is eliminated as a
// direction: its depth column is weak, not singular.
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

void EliminatedPoint::keep(const LandmarkBlock& landmark) {
  L_ = landmark.factor();
  z_ = landmark.z();
  states_.clear();
  for (const LandmarkBlock::State& state : landmark.states()) {
    using Columns = Eigen::Matrix<double, kPaddedRows, 3>;
    states_.pushBack(
        {state.slot, Eigen::Map<const Columns>(state.point[0]).topRows<kPoseDim>().cast<float>()});
  }
  calibration_dimension_ = landmark.calibrationDimension();
  if (calibration_dimension_ > 0) Y_calibration_ = landmark.calibration().point.cast<float>();
}

Eigen::Vector3d EliminatedPoint::step(const VectorMap& dx,
                                      const std::array<WindowState, kMaxStates>& states) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const StateColumns& columns : states_) {
    sum += columns.Y.transpose() * dx.segment<kPoseDim>(states[columns.slot].offset).cast<float>();
  }
  for (int k = 0; k < calibration_dimension_; ++k) {
    sum += Y_calibration_.row(k).transpose() * static_cast<float>(dx[k]);
  }
  Eigen::Vector3d result = -(z_ + sum.cast<double>());
  L_.solveTransposed(result);
  return result;
}

}  // namespace swiftlet
