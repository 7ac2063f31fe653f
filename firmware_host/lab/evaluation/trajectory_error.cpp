#include "firmware_host/lab/evaluation/trajectory_error.hpp"

#include <Eigen/SVD>
#include <cmath>

#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/yaw_rotation.hpp"

namespace swiftlet {
namespace {

Status align(Points from, Points to, AlignKind kind, Alignment& result) {
  switch (kind) {
    case AlignKind::kSe3:
      return alignRigid(from, to, result);
    case AlignKind::kSim3:
      return alignSimilarity(from, to, result);
    case AlignKind::kYaw:
      return alignYaw(from, to, result);
  }
  return {StatusCode::kInvalidInput, "unknown kind of alignment"};
}

/// The rotation R that minimizes sum |R_truth - R R_estimate|^2 (Frobenius; Moakher 2002), or the one
/// about z alone.
Eigen::Quaterniond fitRotation(std::span<const PosePair> pairs, AlignKind kind) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const PosePair& pair : pairs) sum += pair.truth.R() * pair.estimate.R().transpose();
  if (kind == AlignKind::kYaw) return yawRotation(sum);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d& U = svd.matrixU();
  const Eigen::Matrix3d& V = svd.matrixV();
  const Eigen::Vector3d signs(1, 1, U.determinant() * V.determinant() < 0 ? -1 : 1);
  return Eigen::Quaterniond(Eigen::Matrix3d(U * signs.asDiagonal() * V.transpose()));
}

ErrorStatistics rotationErrors(std::span<const PosePair> pairs, const Eigen::Quaterniond& R_truth_estimate) {
  std::vector<double> degrees;
  for (const PosePair& pair : pairs) {
    const Eigen::Quaterniond turned = R_truth_estimate * pair.estimate.rotation;
    degrees.push_back(logSo3(Eigen::Quaterniond(pair.truth.rotation.conjugate() * turned)).norm() *
                      kToDegrees);
  }
  return statisticsOf(std::move(degrees));
}

ErrorStatistics tiltErrors(std::span<const PosePair> pairs) {
  std::vector<double> degrees;
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d estimate = pair.estimate.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d truth = pair.truth.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    degrees.push_back(std::atan2(estimate.cross(truth).norm(), estimate.dot(truth)) * kToDegrees);
  }
  return statisticsOf(std::move(degrees));
}

}  // namespace

std::string_view alignName(AlignKind kind) {
  switch (kind) {
    case AlignKind::kSe3:
      return "se3";
    case AlignKind::kSim3:
      return "sim3";
    case AlignKind::kYaw:
      return "yaw";
  }
  return "unknown";
}

TrajectoryError trajectoryError(std::span<const PosePair> pairs, AlignKind kind) {
  TrajectoryError result;
  result.kind = kind;
  std::vector<Eigen::Vector3d> estimate;
  std::vector<Eigen::Vector3d> truth;
  for (const PosePair& pair : pairs) {
    estimate.push_back(pair.estimate.translation);
    truth.push_back(pair.truth.translation);
  }
  result.status = align(estimate, truth, kind, result.alignment);
  if (result.status.code == StatusCode::kInvalidInput) return result;
  if (pairs.size() < kFewestPairs) {
    result.status = {StatusCode::kDegenerate, "alignment: fewer than 3 pairs leave no error to measure"};
    return result;
  }

  std::vector<double> translation;
  Eigen::Vector3d axis_sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d error = truth[i] - result.alignment * estimate[i];
    translation.push_back(error.norm());
    axis_sum += error.cwiseAbs2();
    if (i > 0) result.path_length += (truth[i] - truth[i - 1]).norm();
  }
  result.translation = statisticsOf(std::move(translation));
  result.rotation = rotationErrors(pairs, result.alignment.T_to_from.rotation);
  result.attitude = rotationErrors(pairs, fitRotation(pairs, kind));
  result.tilt = tiltErrors(pairs);
  result.axis_rmse = (axis_sum / static_cast<double>(pairs.size())).cwiseSqrt();
  return result;
}

}  // namespace swiftlet
