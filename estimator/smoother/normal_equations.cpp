#include "estimator/smoother/normal_equations.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace swiftlet {
namespace {

// Relative floor on the point's information, so that a point without parallax is eliminated as a
// direction: its depth column is weak, not singular.
constexpr double kPointDamping = 1e-9;
constexpr double kInverseDepthInformation = 1.0 / (30.0 * 30.0);  // as in triangulate()

using PoseBlockMatrix = Eigen::Matrix<double, kPoseDim, kPoseDim>;

struct SightingTerms {
  std::uint32_t slot = 0;
  bool valid = false;
  alignas(32) double y[3][8];  // (J_pose^T J_point) L^-T, padded columns
};

}  // namespace

NormalEquations::NormalEquations()
    : h_(alignedMapSize(kMaxSystemDim)), g_(kMaxSystemDim), blocks_(kMaxStates * kMaxStates) {}

void NormalEquations::begin(const CalibrationLayout& calibration, int dimension) {
  calibration_ = calibration;
  dimension_ = dimension;
  cost_ = 0;
  H().setZero();
  g().setZero();
  for (PoseBlock& b : blocks_) b.fill(0.0);
  for (auto& gradient : pose_gradient_) gradient.fill(0.0);
  touched_.fill(false);
}

MatrixMap NormalEquations::H() { return alignedMap(h_, dimension_); }

VectorMap NormalEquations::g() { return {g_.data(), dimension_}; }

void NormalEquations::addMotion(const MotionFactor& factor, const WindowState& i, const WindowState& j) {
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
}

void NormalEquations::addDiagonal(const WindowState& state, int first, const Eigen::Vector3d& residual,
                                  double sigma) {
  const double information = 1.0 / (sigma * sigma);
  const int at = state.offset + first;
  for (int k = 0; k < 3; ++k) H()(at + k, at + k) += information;
  g().segment<3>(at) += information * residual;
  cost_ += 0.5 * information * residual.squaredNorm();
}

bool NormalEquations::addLandmark(const Landmark& landmark, RigPoses poses,
                                  const std::array<SE3, kMaxCameras>& T_body_cam,
                                  const std::array<WindowState, kMaxStates>& states) {
  const int calibration_dim = calibration_.dimension();
  const PointBasis basis = PointBasis::of(landmark.point.bearing);
  std::array<SightingTerms, kMaxStates> terms;
  std::array<PoseBlockMatrix, kMaxStates> pose_information;
  std::array<Eigen::Matrix<double, kPoseDim, 3>, kMaxStates> pose_point;
  std::array<Eigen::Matrix<double, kPoseDim, 1>, kMaxStates> pose_gradient;
  Eigen::Matrix3d point_information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, kMaxCalibrationDim, 3> calibration_point =
      Eigen::Matrix<double, kMaxCalibrationDim, 3>::Zero();
  Eigen::Matrix<double, kMaxCalibrationDim, 1> calibration_gradient =
      Eigen::Matrix<double, kMaxCalibrationDim, 1>::Zero();
  Eigen::Matrix<double, kMaxCalibrationDim, kMaxCalibrationDim> calibration_information =
      Eigen::Matrix<double, kMaxCalibrationDim, kMaxCalibrationDim>::Zero();
  std::array<Eigen::Matrix<double, kPoseDim, kMaxCalibrationDim>, kMaxStates> pose_calibration;
  double cost = 0;
  int valid_states = 0;
  const std::size_t n = landmark.sightings.size();

  for (std::size_t s = 0; s < n; ++s) {
    const Sighting& sighting = landmark.sightings[s];
    const RigPose& rig = poses[sighting.slot];
    terms[s].slot = sighting.slot;
    terms[s].valid = false;
    pose_information[s].setZero();
    pose_point[s].setZero();
    pose_gradient[s].setZero();
    if (calibration_dim > 0) pose_calibration[s].setZero();
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      const CameraSighting& view = sighting.camera[c];
      if (!view.used) continue;
      Eigen::Vector2d r;
      SightingJacobians J;
      if (!reprojectionResidual(view, rig.current[c], landmark.point, r)) continue;
      if (!reprojectionJacobians(view, rig.linearization[c], T_body_cam[c], landmark.point, basis,
                                 calibration_.extrinsics, J)) {
        continue;
      }
      const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
      const double root = std::sqrt(robust.weight);
      J.pose *= root;
      J.point *= root;
      r *= root;
      cost += robust.cost;
      pose_information[s].noalias() += J.pose.transpose() * J.pose;
      pose_point[s].noalias() += J.pose.transpose() * J.point;
      pose_gradient[s].noalias() += J.pose.transpose() * r;
      point_information.noalias() += J.point.transpose() * J.point;
      point_gradient.noalias() += J.point.transpose() * r;
      terms[s].valid = true;
      if (calibration_dim > 0) {
        Eigen::Matrix<double, 2, kMaxCalibrationDim> Jc =
            Eigen::Matrix<double, 2, kMaxCalibrationDim>::Zero();
        if (calibration_.time_offset) {
          Jc.col(0) = J.pose.leftCols<3>() * rig.omega_body + J.pose.rightCols<3>() * rig.v_world;
        }
        if (calibration_.extrinsics) {
          Jc.block<2, kPoseDim>(0, calibration_.extrinsicOffset(c)) = root * J.extrinsic;
        }
        calibration_information.noalias() += Jc.transpose() * Jc;
        pose_calibration[s].noalias() += J.pose.transpose() * Jc;
        calibration_point.noalias() += Jc.transpose() * J.point;
        calibration_gradient.noalias() += Jc.transpose() * r;
      }
    }
    if (terms[s].valid) ++valid_states;
  }
  if (valid_states < 2) return false;

  point_information(2, 2) += kInverseDepthInformation;
  point_information.diagonal() *= 1.0 + kPointDamping;
  const Eigen::LLT<Eigen::Matrix3d> llt(point_information);
  if (llt.info() != Eigen::Success) return false;
  const Eigen::Matrix3d L_inverse = llt.matrixL().solve(Eigen::Matrix3d::Identity());
  const Eigen::Vector3d z = L_inverse * point_gradient;
  cost_ += cost;

  for (std::size_t s = 0; s < n; ++s) {
    if (!terms[s].valid) continue;
    touched_[terms[s].slot] = true;
    const Eigen::Matrix<double, kPoseDim, 3> Y = pose_point[s] * L_inverse.transpose();
    for (int k = 0; k < 3; ++k) {
      for (int row = 0; row < kPoseDim; ++row) terms[s].y[k][row] = Y(row, k);
      terms[s].y[k][6] = 0;
      terms[s].y[k][7] = 0;
    }
    PoseBlock& diagonal = block(terms[s].slot, terms[s].slot);
    for (int column = 0; column < kPoseDim; ++column) {
      for (int row = 0; row < kPoseDim; ++row) {
        diagonal[static_cast<std::size_t>(column * kRows + row)] += pose_information[s](row, column);
      }
    }
    auto& gradient = pose_gradient_[terms[s].slot];
    for (int row = 0; row < kPoseDim; ++row) {
      gradient[static_cast<std::size_t>(row)] += pose_gradient[s][row] - Y.row(row).dot(z);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!terms[i].valid) continue;
    for (std::size_t j = 0; j < n; ++j) {
      if (!terms[j].valid || states[terms[i].slot].offset < states[terms[j].slot].offset) continue;
      double* const target = block(terms[i].slot, terms[j].slot).data();
      for (int column = 0; column < kPoseDim; ++column) {
        const double a = terms[j].y[0][column];
        const double b = terms[j].y[1][column];
        const double c = terms[j].y[2][column];
        for (int row = 0; row < kRows; ++row) {
          target[column * kRows + row] -=
              a * terms[i].y[0][row] + b * terms[i].y[1][row] + c * terms[i].y[2][row];
        }
      }
    }
  }
  if (calibration_dim > 0) {
    MatrixMap h = H();
    const Eigen::Matrix<double, kMaxCalibrationDim, 3> Yc = calibration_point * L_inverse.transpose();
    h.topLeftCorner(calibration_dim, calibration_dim) +=
        (calibration_information - Yc * Yc.transpose()).topLeftCorner(calibration_dim, calibration_dim);
    g().head(calibration_dim) += (calibration_gradient - Yc * z).head(calibration_dim);
    for (std::size_t s = 0; s < n; ++s) {
      if (!terms[s].valid) continue;
      const Eigen::Matrix<double, kPoseDim, 3> Y = pose_point[s] * L_inverse.transpose();
      h.block(states[terms[s].slot].offset, 0, kPoseDim, calibration_dim) +=
          (pose_calibration[s] - Y * Yc.transpose()).leftCols(calibration_dim);
    }
  }
  return true;
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
      const PoseBlock& source = block(i, j);
      for (int column = 0; column < kPoseDim; ++column) {
        for (int row = 0; row < kPoseDim; ++row) {
          h(at_i + row, states[j].offset + column) += source[static_cast<std::size_t>(column * kRows + row)];
        }
      }
    }
  }
}

}  // namespace swiftlet
