#include "firmware_host/lab/evaluation/mesh_registration.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kSamples = 20'000;
constexpr std::size_t kLeastPairs = 100;
constexpr int kMostIterations = 50;
// Larger residuals are down-weighted: edges of the truth that the mesh rounds off [m].
constexpr double kHuber = 0.02;
constexpr double kSettled = 1e-4;  // m, rad

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  std::size_t pairs = 0;

  /// Adds the plane through `on` with `normal`; motion about the origin, rotation first.
  void add(const Eigen::Vector3d& point, const Eigen::Vector3d& on, const Eigen::Vector3d& normal) {
    const double residual = normal.dot(point - on);
    const double weight = std::abs(residual) <= kHuber ? 1 : kHuber / std::abs(residual);
    Vector6d J;
    J << point.cross(normal), normal;
    H += weight * J * J.transpose();
    b -= weight * residual * J;
    ++pairs;
  }
};

}  // namespace

MeshRegistration registerMesh(const TriangleMesh& mesh, const TriangleMesh& truth,
                              const TrueSurface& surface) {
  MeshRegistration result;
  const double area = areaOf(mesh);
  if (!(area > 0)) return result;
  const std::vector<SurfaceSample> samples = sampleSurface(mesh, std::min(kSurfaceDensity, kSamples / area));
  SE3& motion = result.motion.T_to_from;
  for (result.iterations = 0; result.iterations < kMostIterations && !result.settled; ++result.iterations) {
    NormalEquations equations;
    for (const SurfaceSample& sample : samples) {
      const Eigen::Vector3d point = motion * sample.point;
      const auto nearest = surface.distance().nearest(point, kFurthestPair);
      if (!nearest) continue;
      const Eigen::Vector3d on = truth.vertices[truth.faces[nearest->face][0]].cast<double>();
      equations.add(point, on, surface.distance().normal(nearest->face));
    }
    result.pairs = equations.pairs;
    if (equations.pairs < kLeastPairs) {
      motion = SE3();
      return result;
    }
    // Directions that the surface does not determine (one plane alone) are not moved.
    const Matrix6d damping = 1e-6 * equations.H.diagonal().maxCoeff() * Matrix6d::Identity();
    const Vector6d step = (equations.H + damping).ldlt().solve(equations.b);
    SE3 turn;
    turn.rotation = expSo3(step.head<3>());
    turn.translation = step.tail<3>();
    motion = turn * motion;
    result.settled = step.head<3>().norm() < kSettled && step.tail<3>().norm() < kSettled;
  }
  return result;
}

}  // namespace swiftlet
