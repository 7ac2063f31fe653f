#include "estimator/geometry/triangulation.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

// Camera centres closer than this [m] count as one: no baseline.
constexpr double kMinExtent = 1e-9;
constexpr double kMinHomogeneous = 1e-12;

using Bearings = std::span<const Eigen::Vector3d>;
using Poses = std::span<const SE3>;

// Angle of two unit vectors, exact near 0 and pi.
double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// The ray with the largest angle to the given one.
std::size_t farthestRay(Bearings bearings, Poses poses, const Eigen::Vector3d& ray) {
  std::size_t best = 0;
  double lowest = 2;
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const double cosine = ray.dot(poses[i].rotation * bearings[i]);
    if (cosine < lowest) {
      lowest = cosine;
      best = i;
    }
  }
  return best;
}

// Largest angle between two rays: exact for two views, at least half of it for more.
double parallaxOf(Bearings bearings, Poses poses) {
  const std::size_t a = farthestRay(bearings, poses, poses[0].rotation * bearings[0]);
  const Eigen::Vector3d ray_a = poses[a].rotation * bearings[a];
  const std::size_t b = farthestRay(bearings, poses, ray_a);
  return angleBetween(ray_a, poses[b].rotation * bearings[b]);
}

// Homogeneous point relative to `centre`, in units of `extent`; fourth entry >= 0.
Eigen::Vector4d solveDlt(Bearings bearings, Poses poses, const Eigen::Vector3d& centre, double extent) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const Eigen::Vector3d ray = poses[i].rotation * bearings[i];
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    const Eigen::Vector3d offset = across * ((poses[i].translation - centre) / extent);
    normal.topLeftCorner<3, 3>() += across;
    normal.topRightCorner<3, 1>() -= offset;
    normal(3, 3) += offset.squaredNorm();
  }
  normal.bottomLeftCorner<1, 3>() = normal.topRightCorner<3, 1>().transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(normal);
  const Eigen::Vector4d x = solver.eigenvectors().col(0);
  return x[3] < 0 ? Eigen::Vector4d(-x) : x;
}

// Angular errors at the point, their normal equations, and whether it lies in front of every camera.
struct Errors {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double sum_squared = 0;
  double max = 0;
  double nearest = std::numeric_limits<double>::infinity();
  bool in_front = true;
};

Errors errorsAt(const Eigen::Vector3d& point, Bearings bearings, Poses poses) {
  Errors errors;
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const Eigen::Vector3d ray = poses[i].rotation * bearings[i];
    const Eigen::Vector3d offset = point - poses[i].translation;
    const double distance = offset.norm();
    const Eigen::Vector3d seen = offset / distance;
    const double angle = angleBetween(seen, ray);
    // Chord on the sphere; its component across the line of sight is the tangent error.
    const Eigen::Vector3d residual = seen - ray;
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - seen * seen.transpose()) / distance;
    errors.information += across * across;
    errors.gradient += across * residual;
    errors.sum_squared += angle * angle;
    errors.max = std::max(errors.max, angle);
    errors.nearest = std::min(errors.nearest, distance);
    errors.in_front = errors.in_front && seen.dot(ray) > 0;
  }
  return errors;
}

TriangulationState judge(const Triangulation& result, const Errors& errors, double first_depth,
                         const TriangulationSettings& settings) {
  if (!errors.in_front) return TriangulationState::kBehind;
  if (!(result.condition < settings.max_condition)) return TriangulationState::kNoParallax;
  if (errors.nearest < settings.min_depth) return TriangulationState::kTooNear;
  if (first_depth > settings.max_depth) return TriangulationState::kTooFar;
  if (errors.max > settings.max_error) return TriangulationState::kOutlier;
  return TriangulationState::kValid;
}

}  // namespace

Triangulation triangulate(Bearings bearings, Poses T_world_cam, const TriangulationSettings& settings) {
  Triangulation result;
  const std::size_t count = bearings.size();
  if (count < 2 || count != T_world_cam.size()) return result;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const SE3& pose : T_world_cam) centre += pose.translation / static_cast<double>(count);
  double extent = 0;
  for (const SE3& pose : T_world_cam) extent = std::max(extent, (pose.translation - centre).norm());
  double check = extent;
  for (std::size_t i = 0; i < count; ++i) check += (T_world_cam[i].rotation * bearings[i]).sum();
  if (!std::isfinite(check)) return result;

  result.state = TriangulationState::kNoParallax;
  result.parallax = parallaxOf(bearings, T_world_cam);
  if (!(extent > kMinExtent) || result.parallax < settings.min_parallax) return result;
  const Eigen::Vector4d homogeneous = solveDlt(bearings, T_world_cam, centre, extent);
  if (!(homogeneous[3] > kMinHomogeneous)) return result;

  Eigen::Vector3d point = centre + homogeneous.head<3>() * (extent / homogeneous[3]);
  Errors errors = errorsAt(point, bearings, T_world_cam);
  for (int step = 0; step < settings.refine_steps && errors.in_front; ++step) {
    const Eigen::Vector3d candidate = point - errors.information.ldlt().solve(errors.gradient);
    const Errors candidate_errors = errorsAt(candidate, bearings, T_world_cam);
    if (!(candidate_errors.sum_squared < errors.sum_squared)) break;
    point = candidate;
    errors = candidate_errors;
  }
  result.point = point;
  result.information = errors.information;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(errors.information, Eigen::EigenvaluesOnly);
  const Eigen::Vector3d& values = eigen.eigenvalues();
  result.condition = values[0] > 0 ? values[2] / values[0] : std::numeric_limits<double>::infinity();
  result.max_error = errors.max;
  const double first_depth = (point - T_world_cam[0].translation).norm();
  result.state = judge(result, errors, first_depth, settings);
  return result;
}

}  // namespace swiftlet
