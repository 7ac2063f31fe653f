#include "firmware_host/evaluation/trajectory_error.hpp"

#include <cmath>
#include <numbers>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

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

  std::vector<double> translation;
  std::vector<double> rotation;
  Eigen::Vector3d axis_sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d error = truth[i] - result.alignment * estimate[i];
    translation.push_back(error.norm());
    axis_sum += error.cwiseAbs2();
    const Eigen::Quaterniond turned = result.alignment.T_to_from.rotation * pairs[i].estimate.rotation;
    rotation.push_back(logSo3(Eigen::Quaterniond(pairs[i].truth.rotation.conjugate() * turned)).norm() *
                       kDegrees);
    if (i > 0) result.path_length += (truth[i] - truth[i - 1]).norm();
  }
  result.translation = statisticsOf(std::move(translation));
  result.rotation = statisticsOf(std::move(rotation));
  result.axis_rmse = (axis_sum / static_cast<double>(pairs.size())).cwiseSqrt();
  return result;
}

}  // namespace swiftlet
