#include "firmware_host/lab/evaluation/consistency.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/yaw_rotation.hpp"

namespace swiftlet {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

template <int kSize>
double squaredNorm(const Eigen::Matrix<double, kSize, kSize>& covariance,
                   const Eigen::Matrix<double, kSize, 1>& error) {
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> factor(covariance);
  if (factor.info() != Eigen::Success) return std::nan("");
  return factor.matrixL().solve(error).squaredNorm();
}

}  // namespace

std::vector<ConsistencyError> consistencyErrors(std::span<const ConsistencySample> samples) {
  std::vector<ConsistencyError> errors;
  if (samples.empty()) return errors;
  const SE3& first = samples.front().estimate;
  const SE3& first_truth = samples.front().truth;
  const Eigen::Quaterniond turn = yawRotation(first_truth.R() * first.R().transpose());
  const SE3 T_truth_estimate(turn, first_truth.translation - turn * first.translation);
  // The position block rotates with the world axes.
  Matrix6d turned = Matrix6d::Identity();
  turned.bottomRightCorner<3, 3>() = turn.toRotationMatrix();
  errors.reserve(samples.size());
  for (const ConsistencySample& sample : samples) {
    const SE3 estimate = T_truth_estimate * sample.estimate;
    ConsistencyError found;
    found.error << logSo3(Eigen::Quaterniond(estimate.rotation.conjugate() * sample.truth.rotation)),
        sample.truth.translation - estimate.translation;
    found.covariance = turned * sample.covariance * turned.transpose();
    errors.push_back(found);
  }
  return errors;
}

Consistency consistency(std::span<const ConsistencySample> samples) {
  Consistency result;
  if (samples.empty()) return result;
  std::size_t inside = 0;
  const std::vector<ConsistencyError> errors = consistencyErrors(samples);
  for (std::size_t i = 1; i < errors.size(); ++i) {
    const Vector6d& error = errors[i].error;
    const Matrix6d& covariance = errors[i].covariance;
    const double pose = squaredNorm<6>(covariance, error);
    if (!std::isfinite(pose)) {
      ++result.without_covariance;
      continue;
    }
    ++result.count;
    result.nees_pose += pose;
    result.nees_rotation += squaredNorm<3>(covariance.topLeftCorner<3, 3>(), error.head<3>());
    result.nees_position += squaredNorm<3>(covariance.bottomRightCorner<3, 3>(), error.tail<3>());
    for (int axis = 0; axis < 6; ++axis) {
      if (error[axis] * error[axis] <= 9 * covariance(axis, axis)) ++inside;
    }
  }
  if (result.count == 0) return result;
  const auto n = static_cast<double>(result.count);
  result.nees_pose /= n;
  result.nees_rotation /= n;
  result.nees_position /= n;
  result.inside_3_sigma = static_cast<double>(inside) / (6 * n);
  return result;
}

}  // namespace swiftlet
