#include "firmware_host/lab/calibrate/board/homography.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace swiftlet {
namespace {

/// Transform to mean zero and mean distance one.
Eigen::Matrix3d normalizer(std::span<const PointPair> pairs, Eigen::Vector2d PointPair::*point) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const PointPair& pair : pairs) mean += pair.*point;
  mean /= static_cast<double>(pairs.size());
  double distance = 0;
  for (const PointPair& pair : pairs) distance += (pair.*point - mean).norm();
  const double scale = static_cast<double>(pairs.size()) / std::max(distance, 1e-12);
  Eigen::Matrix3d N = Eigen::Matrix3d::Identity();
  N.topLeftCorner<2, 2>() *= scale;
  N.topRightCorner<2, 1>() = -scale * mean;
  return N;
}

}  // namespace

bool fitHomography(std::span<const PointPair> pairs, Eigen::Matrix3d& H) {
  if (pairs.size() < 4) return false;
  const Eigen::Matrix3d from = normalizer(pairs, &PointPair::from);
  const Eigen::Matrix3d to = normalizer(pairs, &PointPair::to);
  Eigen::Matrix<double, 9, 9> A = Eigen::Matrix<double, 9, 9>::Zero();
  for (const PointPair& pair : pairs) {
    const Eigen::Vector3d x = from * pair.from.homogeneous();
    const Eigen::Vector2d y = (to * pair.to.homogeneous()).hnormalized();
    Eigen::Matrix<double, 2, 9> row = Eigen::Matrix<double, 2, 9>::Zero();
    row.block<1, 3>(0, 0) = x.transpose();
    row.block<1, 3>(1, 3) = x.transpose();
    row.block<1, 3>(0, 6) = -y.x() * x.transpose();
    row.block<1, 3>(1, 6) = -y.y() * x.transpose();
    A.noalias() += row.transpose() * row;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(A);
  // A second direction without residual: the points do not determine the map.
  if (solver.info() != Eigen::Success || !(solver.eigenvalues()[1] > 1e-9)) return false;
  const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
  Eigen::Matrix3d M;
  M << h.head<3>().transpose(), h.segment<3>(3).transpose(), h.tail<3>().transpose();
  H = to.inverse() * M * from;
  return H.allFinite();
}

}  // namespace swiftlet
