#include "firmware_host/lab/calibrate/cameras/board_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kFewestCorners = 6;
constexpr int kPoseSteps = 20;
constexpr double kPoseHuber = 2;                                            // px
using Bearings = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;  // on the board, from the camera

std::optional<SE3> fromHomography(const Bearings& seen) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& [point, bearing] : seen) centre += point / static_cast<double>(seen.size());
  double size = 0;
  for (const auto& [point, bearing] : seen) size = std::max(size, (point - centre).norm());
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (const auto& [point, bearing] : seen) {
    const Eigen::Vector3d x((point.x() - centre.x()) / size, (point.y() - centre.y()) / size, 1);
    Eigen::Matrix<double, 3, 9> rows;  // bearing x H x = 0, H column by column
    for (int k = 0; k < 3; ++k) rows.middleCols<3>(3 * k) = x[k] * hat(bearing);
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(normal);
  if (!(eigen.eigenvalues()[1] > 1e-9 * eigen.eigenvalues()[8])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << h.head<3>(), h.segment<3>(3), h.tail<3>();
  double front = 0;
  for (const auto& [point, bearing] : seen) {
    front +=
        bearing.dot(H * Eigen::Vector3d((point.x() - centre.x()) / size, (point.y() - centre.y()) / size, 1));
  }
  if (front < 0) H = -H;
  const double scale = 0.5 * (H.col(0).norm() + H.col(1).norm());
  Eigen::Matrix3d R;
  R << H.col(0) / scale, H.col(1) / scale, (H.col(0).cross(H.col(1))) / (scale * scale);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  R = svd.matrixU() * svd.matrixV().transpose();
  if (R.determinant() < 0) return std::nullopt;
  const Eigen::Vector3d at_centre = H.col(2) * size / scale;
  return SE3(R, at_centre - R * centre);
}

}  // namespace

std::optional<SE3> boardPose(const CalibrationTarget& target, const CameraModel& lens, const BoardView& view,
                             double most_rms) {
  if (view.corners.size() < kFewestCorners) return std::nullopt;
  Bearings seen;
  for (const BoardCorner& corner : view.corners) {
    Eigen::Vector3d bearing;
    if (lens.unproject(corner.pixel, bearing)) seen.emplace_back(target.corner(corner.id), bearing);
  }
  if (seen.size() < kFewestCorners) return std::nullopt;
  std::optional<SE3> start = fromHomography(seen);
  if (!start) return std::nullopt;
  SE3 T = *start;
  double rms = 0;
  for (int step = 0; step < kPoseSteps; ++step) {
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    double sum = 0;
    double weights = 0;
    for (const BoardCorner& corner : view.corners) {
      const Eigen::Vector3d point = target.corner(corner.id);
      Eigen::Vector2d pixel;
      Matrix23d by_point;
      if (!lens.project(T * point, pixel, &by_point)) continue;
      const Eigen::Vector2d r = corner.pixel - pixel;
      const double weight = std::min(1.0, kPoseHuber / std::max(r.norm(), 1e-12));
      Eigen::Matrix<double, 2, 6> J;
      J << -by_point * T.R() * hat(point), by_point;
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
      sum += weight * r.squaredNorm();
      weights += weight;
    }
    if (weights < kFewestCorners / 2.0) return std::nullopt;
    const Eigen::Matrix<double, 6, 1> move = H.ldlt().solve(g);
    if (!move.allFinite()) return std::nullopt;
    T = SE3(T.rotation * expSo3(move.head<3>()), T.translation + move.tail<3>());
    rms = std::sqrt(sum / (2 * weights));
    if (move.norm() < 1e-9) break;
  }
  if (!(rms < most_rms)) return std::nullopt;
  return T;
}

}  // namespace swiftlet
