#include "estimator/smoother/vision_factor.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/point_system.hpp"

namespace swiftlet {
namespace {

// No object is nearer to a flying camera than this.
constexpr double kMaxInverseDepth = 20.0;  // 1/m
// Assumed for a point with a single observation by one camera.
constexpr double kGuessedInverseDepth = 0.3;  // 1/m
constexpr double kStepTolerance = 1e-5;
constexpr double kCostRounding = 1e-9;  // relative, and in squared sigmas: far below any significant change

// Along the ray of the first observation the residuals are nearly linear in the inverse depth.
void triangulateLinearly(RigPoses poses, std::span<const Sighting> sightings, LandmarkPoint& point) {
  const Sighting& first = sightings.front();
  const std::size_t c0 = first.camera[0].used ? 0 : 1;
  const CameraPose& anchor = poses[first.slot].current[c0];
  point.reference = anchor.centerAt(first.camera[c0]);
  point.bearing = anchor.R_cam_world.transpose() * anchor.inMiddleRow(first.camera[c0]).ray;
  double numerator = 0;
  double denominator = 0;
  for (const Sighting& sighting : sightings) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      const CameraSighting& view = sighting.camera[c];
      if (!view.used) continue;
      const CameraPose& camera = poses[sighting.slot].current[c];
      const Matrix23d W = camera.inMiddleRow(view).whitening;
      const Eigen::Vector2d a = W * (camera.R_cam_world * point.bearing);
      const Eigen::Vector2d b = W * (camera.R_cam_world * (point.reference - camera.centerAt(view)));
      numerator -= a.dot(b);
      denominator += b.dot(b);
    }
  }
  // With less than one sigma of parallax for a point at one metre, the data do not determine the depth.
  const bool known = denominator > 1.0 * 1.0;
  point.inverse_depth =
      known ? std::clamp(numerator / denominator, 1e-3, kMaxInverseDepth) : kGuessedInverseDepth;
}

}  // namespace

CameraPose CameraPose::of(const SE3& T_world_body, const SE3& T_body_cam) {
  const SE3 T_world_cam = T_world_body * T_body_cam;
  return {T_world_cam.R().transpose(), T_world_cam.translation, {}};
}

RowMotion RowMotion::of(double readout, const ScanTurn& turn, const SE3& T_body_cam, const SE3& T_world_body,
                        const Eigen::Vector3d& v_world) {
  const Eigen::Quaterniond R_cam_body = T_body_cam.rotation.conjugate();
  return {readout, v_world + T_world_body.rotation * turn.mean().cross(T_body_cam.translation),
          R_cam_body * turn.before, R_cam_body * turn.after};
}

Eigen::Vector3d CameraPose::centerAt(const CameraSighting& sighting) const {
  return center + rows.readout * static_cast<double>(sighting.row) * rows.velocity;
}

CameraPose::Seen CameraPose::inMiddleRow(const CameraSighting& sighting) const {
  if (rows.none()) return {sighting.ray(), sighting.whitening()};
  const auto row = static_cast<double>(sighting.row);
  const Eigen::Matrix3d R = expSo3Matrix(rows.readout * row * (row < 0 ? rows.before : rows.after));
  return {R * sighting.ray(), sighting.whitening() * R.transpose()};
}

void RigPose::place(std::size_t c, const SE3& T_body_cam, const SE3& now, double readout,
                    const ScanTurn& scan) {
  current[c] = CameraPose::of(now, T_body_cam);
  linearization[c] = current[c];
  if (readout == 0) return;
  linearization[c].rows = current[c].rows = RowMotion::of(readout, scan, T_body_cam, now, v_world);
  linearization[c].rows.velocity.setZero();
}

PointBasis PointBasis::of(const Eigen::Vector3d& bearing) {
  const Eigen::Vector3d axis =
      std::abs(bearing.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d b1 = bearing.cross(axis).normalized();
  return {b1, bearing.cross(b1)};
}

void movePoint(const Eigen::Vector3d& step, const PointBasis& basis, LandmarkPoint& point) {
  const Eigen::Vector3d moved = point.bearing + step[0] * basis.b1 + step[1] * basis.b2;
  const double scale = 1.0 / moved.norm();
  point.bearing = moved * scale;
  point.inverse_depth = std::clamp((point.inverse_depth + step[2]) * scale, 0.0, kMaxInverseDepth);
}

RobustWeight RobustWeight::cauchy(double squared_norm, double information_scale) {
  const double c2 = kCauchyScale * kCauchyScale;
  return {information_scale / (1.0 + squared_norm / c2),
          0.5 * information_scale * c2 * std::log1p(squared_norm / c2)};
}

Sighting makeSighting(const Rig& rig, const std::array<bool, kMaxCameras>& seen,
                      const std::array<Eigen::Vector2f, kMaxCameras>& pixel, double pixel_sigma,
                      std::uint32_t slot) {
  Sighting sighting;
  sighting.slot = slot;
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    Eigen::Vector3d ray;
    Eigen::Vector2d back;
    Matrix23d J;
    if (!seen[c] || !rig.camera[c].unproject(pixel[c].cast<double>(), ray)) continue;
    if (!rig.camera[c].project(ray, back, &J)) continue;
    sighting.camera[c] = CameraSighting::of(ray, J / pixel_sigma);
    sighting.camera[c].row = static_cast<float>(rig.row(c, static_cast<double>(pixel[c].y())));
  }
  return sighting;
}

bool reprojectionResidual(const CameraSighting& sighting, const CameraPose& camera,
                          const LandmarkPoint& point, Eigen::Vector2d& residual) {
  const Eigen::Vector3d h =
      camera.R_cam_world *
      (point.bearing + point.inverse_depth * (point.reference - camera.centerAt(sighting)));
  const CameraPose::Seen seen = camera.inMiddleRow(sighting);
  const double along = seen.ray.dot(h);
  if (!(along > kMinCosine * h.norm())) return false;
  residual = seen.whitening * h / along;
  return true;
}

bool reprojectionJacobians(const CameraSighting& sighting, const CameraPose& camera, const SE3& T_body_cam,
                           const LandmarkPoint& point, const PointBasis& basis, bool with_extrinsic,
                           SightingJacobians& jacobians) {
  const Eigen::Vector3d arm = point.reference - camera.centerAt(sighting);
  const Eigen::Vector3d h = camera.R_cam_world * (point.bearing + point.inverse_depth * arm);
  const auto [m, W] = camera.inMiddleRow(sighting);
  const double along = m.dot(h);
  if (!(along > kMinCosine * h.norm())) return false;
  const Eigen::Vector2d r = W * h / along;
  const Matrix23d G = (W - r * m.transpose()) / along;  // d r / d h
  const Matrix23d M = G * camera.R_cam_world;
  const Eigen::Matrix3d R_body_cam = T_body_cam.R();
  const Matrix23d K = G * R_body_cam.transpose();  // d r / d (ray in body axes)
  const Eigen::Vector3d ray_body = R_body_cam * h + point.inverse_depth * T_body_cam.translation;
  // k^T hat(x) = (k x x)^T
  jacobians.pose.block<1, 3>(0, 0) = K.row(0).transpose().cross(ray_body).transpose();
  jacobians.pose.block<1, 3>(1, 0) = K.row(1).transpose().cross(ray_body).transpose();
  jacobians.pose.rightCols<3>() = -point.inverse_depth * M;
  jacobians.point.col(0) = M * basis.b1;
  jacobians.point.col(1) = M * basis.b2;
  jacobians.point.col(2) = M * arm;
  if (with_extrinsic) {
    jacobians.extrinsic.block<1, 3>(0, 0) = G.row(0).transpose().cross(h).transpose();
    jacobians.extrinsic.block<1, 3>(1, 0) = G.row(1).transpose().cross(h).transpose();
    jacobians.extrinsic.rightCols<3>() = -point.inverse_depth * K;
  }
  return true;
}

bool triangulate(RigPoses poses, std::span<const Sighting> sightings, int max_iterations,
                 LandmarkPoint& point) {
  if (sightings.empty()) return false;
  if (!point.triangulated) triangulateLinearly(poses, sightings, point);
  double lambda = 0;
  PointBasis basis = PointBasis::of(point.bearing);
  const PointViews views(poses, sightings);
  PointSystem system = views.linearize(point, basis);
  for (int i = 0; i < max_iterations && system.in_front; ++i) {
    Eigen::Matrix3d H = system.H;
    H(2, 2) += kInverseDepthInformation;
    H.diagonal() *= 1.0 + lambda;
    const Eigen::Vector3d step = -H.llt().solve(system.g);
    if (!step.allFinite()) return false;
    const Eigen::Vector3d bearing_before = point.bearing;
    const double inverse_depth_before = point.inverse_depth;
    movePoint(step, basis, point);
    const PointBasis moved_basis = PointBasis::of(point.bearing);
    const PointSystem moved = views.linearize(point, moved_basis);
    if (!moved.in_front || moved.cost > system.cost * (1.0 + kCostRounding) + kCostRounding) {
      point.bearing = bearing_before;
      point.inverse_depth = inverse_depth_before;
      lambda = std::max(10.0 * lambda, 1e-2);
      continue;
    }
    basis = moved_basis;
    system = moved;
    if (step.squaredNorm() < kStepTolerance * kStepTolerance) break;
  }
  if (!system.in_front || system.views < 2) return false;
  Eigen::Matrix3d H = system.H;
  H(2, 2) += kInverseDepthInformation;
  const Eigen::Vector3d column = H.llt().solve(Eigen::Vector3d::UnitZ());
  point.inverse_depth_sigma = std::sqrt(std::max(column.z(), 0.0));
  point.triangulated = true;
  return true;
}

}  // namespace swiftlet
