#include "estimator/smoother/normal_equations.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/landmark_lanes.hpp"

namespace swiftlet {
namespace {

using PoseVector = Eigen::Matrix<double, kPoseDim, 1>;
using PoseBlockMatrix = Eigen::Matrix<double, kPoseDim, kPoseDim>;
using PosePoint = Eigen::Matrix<double, kPoseDim, 3>;
using CalibrationVector = Eigen::Matrix<double, kMaxCalibrationDim, 1>;
using CalibrationMatrix = Eigen::Matrix<double, kMaxCalibrationDim, kMaxCalibrationDim>;
using CalibrationPoint = Eigen::Matrix<double, kMaxCalibrationDim, 3>;
using CalibrationRows = Eigen::Matrix<double, 2, kMaxCalibrationDim>;

// One landmark, linearized; names as in landmark_lanes.hpp, k for the calibration's columns.
struct CalibratedLandmark {
  struct Pose {
    std::uint32_t slot = 0;
    bool valid = false;
    PoseBlockMatrix A = PoseBlockMatrix::Zero();
    PosePoint B = PosePoint::Zero();
    PoseVector a = PoseVector::Zero();
    Eigen::Matrix<double, kPoseDim, kMaxCalibrationDim> A_k =
        Eigen::Matrix<double, kPoseDim, kMaxCalibrationDim>::Zero();
  };
  FixedVector<Pose, kMaxStates> poses;
  Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  CalibrationMatrix K = CalibrationMatrix::Zero();
  CalibrationPoint B_k = CalibrationPoint::Zero();
  CalibrationVector a_k = CalibrationVector::Zero();
  double cost = 0;

  // One view; its Jacobians, residual and calibration columns already weighted.
  void add(const SightingJacobians& J, const CalibrationRows& Jk, const Eigen::Vector2d& r, Pose& pose) {
    pose.valid = true;
    pose.A.noalias() += J.pose.transpose() * J.pose;
    pose.B.noalias() += J.pose.transpose() * J.point;
    pose.a.noalias() += J.pose.transpose() * r;
    pose.A_k.noalias() += J.pose.transpose() * Jk;
    C.noalias() += J.point.transpose() * J.point;
    c.noalias() += J.point.transpose() * r;
    K.noalias() += Jk.transpose() * Jk;
    B_k.noalias() += Jk.transpose() * J.point;
    a_k.noalias() += Jk.transpose() * r;
  }
};

CalibratedLandmark linearize(const Landmark& landmark, const CalibrationLayout& calibration, RigPoses poses,
                             const std::array<SE3, kMaxCameras>& T_body_cam) {
  const PointBasis basis = PointBasis::of(landmark.point.bearing);
  CalibratedLandmark result;
  for (const Sighting& sighting : landmark.sightings) {
    const RigPose& rig = poses[sighting.slot];
    CalibratedLandmark::Pose pose;
    pose.slot = sighting.slot;
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      const CameraSighting& view = sighting.camera[c];
      Eigen::Vector2d r;
      SightingJacobians J;
      if (!view.used || !reprojectionResidual(view, rig.current[c], landmark.point, r) ||
          !reprojectionJacobians(view, rig.linearization[c], T_body_cam[c], landmark.point, basis,
                                 calibration.extrinsics, J)) {
        continue;
      }
      const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
      const double root = std::sqrt(robust.weight);
      J.pose *= root;
      J.point *= root;
      r *= root;
      CalibrationRows Jk = CalibrationRows::Zero();
      if (calibration.time_offset) {
        Jk.col(0) = J.pose.leftCols<3>() * rig.omega_body + J.pose.rightCols<3>() * rig.v_world;
      }
      if (calibration.extrinsics) {
        Jk.block<2, kPoseDim>(0, calibration.extrinsicOffset(c)) = root * J.extrinsic;
      }
      result.cost += robust.cost;
      result.add(J, Jk, r, pose);
    }
    if (pose.valid) static_cast<void>(result.poses.tryPushBack(pose));
  }
  return result;
}

// B L^-T: each row is solved for by itself.
template <typename Rows>
Rows timesInverseTransposed(const Rows& B, const PointFactor& L) {
  Rows Y;
  for (Eigen::Index row = 0; row < B.rows(); ++row) {
    double y[3] = {B(row, 0), B(row, 1), B(row, 2)};
    L.solve(y);
    Y.row(row) << y[0], y[1], y[2];
  }
  return Y;
}

}  // namespace

NormalEquations::NormalEquations()
    : h_(alignedMapSize(kMaxSystemDim)), g_(kMaxSystemDim), blocks_(kMaxStates * kMaxStates) {}

void NormalEquations::begin(const CalibrationLayout& calibration, int dimension) {
  calibration_ = calibration;
  dimension_ = dimension;
  cost_ = 0;
  MatrixMap h = H();
  for (int c = 0; c < dimension; ++c) h.col(c).tail(dimension - c).setZero();
  g().setZero();
  // Only what the last system used is not zero.
  for (std::size_t i = 0; i < kMaxStates; ++i) {
    if (!touched_[i]) continue;
    for (std::size_t j = 0; j < kMaxStates; ++j) {
      if (touched_[j]) block(i, j).fill(0.0);
    }
  }
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

bool NormalEquations::addLandmark(const Landmark& landmark, RigPoses poses,
                                  const std::array<SE3, kMaxCameras>& T_body_cam,
                                  const std::array<WindowState, kMaxStates>& states,
                                  EliminatedPoint* eliminated) {
  return calibration_.dimension() == 0
             ? addLandmarkInLanes(landmark, poses, T_body_cam, states, eliminated)
             : addLandmarkWithCalibration(landmark, poses, T_body_cam, states, eliminated);
}

bool NormalEquations::addLandmarkInLanes(const Landmark& landmark, RigPoses poses,
                                         const std::array<SE3, kMaxCameras>& T_body_cam,
                                         const std::array<WindowState, kMaxStates>& states,
                                         EliminatedPoint* kept) {
  LandmarkLanes linearized(landmark, poses, T_body_cam);
  if (!linearized.eliminate()) return false;
  if (kept != nullptr) kept->begin(linearized.factor(), linearized.z());
  cost_ += linearized.cost();
  std::array<EliminatedPose, kMaxStates> eliminated;
  std::size_t count = 0;
  for (std::size_t s = 0; s < landmark.sightings.size(); ++s) {
    const LandmarkLanes::PoseGroup& group = linearized.groups()[s / lanes::kLanes];
    const std::size_t lane = s % lanes::kLanes;
    if (group.valid[lane] == 0) continue;
    EliminatedPose& pose = eliminated[count++];
    pose.slot = landmark.sightings[s].slot;
    touched_[pose.slot] = true;
    PoseBlock& diagonal = block(pose.slot, pose.slot);
    auto& gradient = pose_gradient_[pose.slot];
    std::size_t entry = 0;
    SWIFTLET_UNROLL
    for (std::size_t i = 0; i < kPoseDim; ++i) {
      SWIFTLET_UNROLL
      for (std::size_t j = i; j < kPoseDim; ++j) diagonal[i * kRows + j] += group.information[entry++][lane];
      gradient[i] += group.gradient[i][lane];
    }
    SWIFTLET_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      SWIFTLET_UNROLL
      for (std::size_t i = 0; i < kPoseDim; ++i) pose.y[k][i] = group.point[i][k][lane];
      pose.y[k][kPoseDim] = pose.y[k][kPoseDim + 1] = 0;
    }
    if (kept != nullptr) kept->addState(pose.slot, pose.y[0], pose.y[1], pose.y[2]);
  }
  subtractPairs({eliminated.data(), count}, states);
  return true;
}

bool NormalEquations::addLandmarkWithCalibration(const Landmark& landmark, RigPoses poses,
                                                 const std::array<SE3, kMaxCameras>& T_body_cam,
                                                 const std::array<WindowState, kMaxStates>& states,
                                                 EliminatedPoint* kept) {
  const CalibratedLandmark linearized = linearize(landmark, calibration_, poses, T_body_cam);
  PointFactor L;
  if (linearized.poses.size() < 2 || !L.compute(linearized.C)) return false;
  cost_ += linearized.cost;
  const int dimension = calibration_.dimension();
  const Eigen::Vector3d z =
      timesInverseTransposed<Eigen::RowVector3d>(linearized.c.transpose(), L).transpose();
  const CalibrationPoint Y_k = timesInverseTransposed(linearized.B_k, L);
  if (kept != nullptr) {
    kept->begin(L, z);
    kept->setCalibration(Y_k, dimension);
  }
  MatrixMap h = H();
  h.topLeftCorner(dimension, dimension) +=
      (linearized.K - Y_k * Y_k.transpose()).topLeftCorner(dimension, dimension);
  g().head(dimension) += (linearized.a_k - Y_k * z).head(dimension);
  std::array<EliminatedPose, kMaxStates> eliminated;
  std::size_t count = 0;
  for (const CalibratedLandmark::Pose& pose : linearized.poses) {
    EliminatedPose& target = eliminated[count++];
    target.slot = pose.slot;
    touched_[pose.slot] = true;
    const PosePoint Y = timesInverseTransposed(pose.B, L);
    for (int k = 0; k < 3; ++k) {
      Eigen::Map<Eigen::Matrix<double, kRows, 1>>(target.y[k]) << Y.col(k), 0, 0;
    }
    if (kept != nullptr) kept->addState(target.slot, target.y[0], target.y[1], target.y[2]);
    Eigen::Map<Eigen::Matrix<double, kRows, kPoseDim>>(block(pose.slot, pose.slot).data())
        .topRows<kPoseDim>() += pose.A - Y * Y.transpose();
    Eigen::Map<PoseVector>(pose_gradient_[pose.slot].data()) += pose.a - Y * z;
    h.block(states[pose.slot].offset, 0, kPoseDim, dimension) +=
        (pose.A_k - Y * Y_k.transpose()).leftCols(dimension);
  }
  subtractPairs({eliminated.data(), count}, states);
  return true;
}

// The only part of a landmark's elimination that is quadratic in its states: a padded column of 8 is two
// vectors, held in registers for state i. Both orders of a pair are met, the one below the diagonal counts.
void NormalEquations::subtractPairs(std::span<const EliminatedPose> poses,
                                    const std::array<WindowState, kMaxStates>& states) {
  using lanes::kLanes;
  using lanes::load;
  using lanes::store;
  using lanes::V;
  static_assert(kRows == 2 * kLanes);
  for (const EliminatedPose& pose_i : poses) {
    V upper0, lower0, upper1, lower1, upper2, lower2;
    load(pose_i.y[0], upper0);
    load(pose_i.y[0] + kLanes, lower0);
    load(pose_i.y[1], upper1);
    load(pose_i.y[1] + kLanes, lower1);
    load(pose_i.y[2], upper2);
    load(pose_i.y[2] + kLanes, lower2);
    for (const EliminatedPose& pose_j : poses) {
      if (&pose_i == &pose_j || states[pose_i.slot].offset < states[pose_j.slot].offset) continue;
      double* const target = block(pose_i.slot, pose_j.slot).data();
      SWIFTLET_UNROLL
      for (std::size_t k = 0; k < kPoseDim; ++k) {
        const double y0 = pose_j.y[0][k];
        const double y1 = pose_j.y[1][k];
        const double y2 = pose_j.y[2][k];
        V upper, lower;
        load(target + k * kRows, upper);
        load(target + k * kRows + kLanes, lower);
        upper -= y0 * upper0 + y1 * upper1 + y2 * upper2;
        lower -= y0 * lower0 + y1 * lower1 + y2 * lower2;
        store(upper, target + k * kRows);
        store(lower, target + k * kRows + kLanes);
      }
    }
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
      const PoseBlock& source = block(i, j);
      for (int column = 0; column < kPoseDim; ++column) {
        for (int row = 0; row < kPoseDim; ++row) {
          h(at_i + row, states[j].offset + column) +=
              source[static_cast<std::size_t>(column) * kRows + static_cast<std::size_t>(row)];
        }
      }
    }
  }
}

}  // namespace swiftlet
