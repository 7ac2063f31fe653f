#include "estimator/geometry/alignment.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// If the second singular value of the cross-covariance is below this share of the first, the points lie on a
// line within rounding and the rotation about it is undetermined.
constexpr double kMinSpreadRatio = 1e-12;

struct Moments {
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_to = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  // mean of to from^T, centred
  double variance_from = 0;
  double variance_to = 0;
};

bool momentsOf(Points from, Points to, Moments& m) {
  if (from.empty() || from.size() != to.size()) return false;
  const double weight = 1.0 / static_cast<double>(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    m.mean_from += weight * from[i];
    m.mean_to += weight * to[i];
  }
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = from[i] - m.mean_from;
    const Eigen::Vector3d b = to[i] - m.mean_to;
    m.cross += weight * b * a.transpose();
    m.variance_from += weight * a.squaredNorm();
    m.variance_to += weight * b.squaredNorm();
  }
  return std::isfinite(m.variance_from) && std::isfinite(m.variance_to);
}

Status invalidInput() {
  return {StatusCode::kInvalidInput, "alignment: point sets are empty, differ in size or hold NaN"};
}

void finish(Points from, Points to, const Moments& m, const Eigen::Quaterniond& rotation, Alignment& result) {
  result.T_to_from = SE3(rotation, m.mean_to - rotation * (result.scale * m.mean_from));
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (result * from[i] - to[i]).squaredNorm();
  result.rms = std::sqrt(sum / static_cast<double>(from.size()));
}

Status align(Points from, Points to, bool with_scale, Alignment& result) {
  Moments m;
  if (!momentsOf(from, to, m)) return invalidInput();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;
  const Eigen::Matrix3d R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  const Eigen::Vector3d& singular = svd.singularValues();
  result.scale =
      with_scale && m.variance_from > 0 ? singular.cwiseProduct(signs).sum() / m.variance_from : 1.0;
  finish(from, to, m, Eigen::Quaterniond(R), result);
  if (!(singular[1] > kMinSpreadRatio * singular[0]) || !(singular[0] > 0)) {
    return {StatusCode::kDegenerate, "alignment: the points lie on a line, the rotation is not determined"};
  }
  return okStatus();
}

}  // namespace

Status alignRigid(Points from, Points to, Alignment& result) { return align(from, to, false, result); }

Status alignSimilarity(Points from, Points to, Alignment& result) { return align(from, to, true, result); }

Status alignYaw(Points from, Points to, Alignment& result) {
  Moments m;
  if (!momentsOf(from, to, m)) return invalidInput();
  // Maximize trace(Rz cross^T): yaw = atan2(b_y a_x - b_x a_y, b_x a_x + b_y a_y).
  const double sine = m.cross(1, 0) - m.cross(0, 1);
  const double cosine = m.cross(0, 0) + m.cross(1, 1);
  const double yaw = std::atan2(sine, cosine);
  result.scale = 1.0;
  finish(from, to, m, Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())), result);
  const double extent = std::sqrt(m.variance_from * m.variance_to);
  if (!(std::hypot(sine, cosine) > kMinSpreadRatio * extent) || !(extent > 0)) {
    return {StatusCode::kDegenerate,
            "alignment: the points have no horizontal extent, yaw is not determined"};
  }
  return okStatus();
}

}  // namespace swiftlet
