// The distance field made of a volume: beside the true distance to a wall and a ball that depth images saw,
// kept true as the vehicle flies on, and the same as one made from nothing.

#include "mapping/distance/volume_distance.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "mapping/volume/volume_integrator.hpp"

using namespace swiftlet;

namespace {

constexpr double kWall = 2.0;  // m, the plane x = 2
const Eigen::Vector3d kBall(1.4, 0.3, 0.1);
constexpr double kRadius = 0.3;
constexpr Stamp kNewest{1000};

/// Depth of the wall with the ball before it, from a camera that looks along x.
struct Scene {
  Scene() {
    view.camera = {150, 150, 119.5, 79.5, 240, 160};
    depth.resize(view.camera.pixels());
    Eigen::Matrix3d R;  // camera's x right, y down, z forward; body's x forward, z up
    R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    view.T_body_camera = SE3(R, Eigen::Vector3d::Zero());
  }

  const DepthImageView& at(double stamp, const SE3& T_world_body) {
    const SE3 T_world_camera = T_world_body * view.T_body_camera;
    for (int v = 0; v < view.camera.height; ++v) {
      for (int u = 0; u < view.camera.width; ++u) {
        const Eigen::Vector3d ray((u - view.camera.cx) / view.camera.fx,
                                  (v - view.camera.cy) / view.camera.fy, 1);
        depth[static_cast<std::size_t>(v * view.camera.width + u)] =
            static_cast<float>(along(T_world_camera.translation, T_world_camera.R() * ray));
      }
    }
    view.stamp = Stamp{static_cast<std::int64_t>(stamp * 1e9)};
    view.depth = depth.data();
    return view;
  }

  /// Multiples of `ray` to the first surface.
  static double along(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
    double t = (kWall - from.x()) / ray.x();
    const Eigen::Vector3d to = from - kBall;
    const double a = ray.squaredNorm();
    const double b = to.dot(ray);
    const double root = b * b - a * (to.squaredNorm() - kRadius * kRadius);
    if (root > 0) t = std::min(t, (-b - std::sqrt(root)) / a);
    return t;
  }

  DepthImageView view;
  std::vector<float> depth;
};

double trueDistance(const Eigen::Vector3d& p) {
  return std::min(kWall - p.x(), (p - kBall).norm() - kRadius);
}

/// The surface point nearest to `p` faced the cameras (from the origin to half a metre on), not only at its
/// rim, and nothing stood before it.
bool nearestWasSeen(const Eigen::Vector3d& p) {
  const Eigen::Vector3d from_ball = p - kBall;
  if (kWall - p.x() < from_ball.norm() - kRadius)
    return std::hypot(from_ball.y(), from_ball.z()) > 2.5 * kRadius;
  const Eigen::Vector3d normal = from_ball.normalized();
  const Eigen::Vector3d to_camera = -(kBall + kRadius * normal);
  return normal.dot(to_camera.normalized()) > 0.4;
}

VolumeSettings volumeSettings() {
  VolumeSettings settings;
  settings.memory_bytes = std::size_t{24} << 20U;
  settings.labels = false;
  return settings;
}

DistanceLimits limits() {
  DistanceLimits limits;
  limits.cells = {96, 80, 64};
  limits.reach = 24;
  return limits;
}

SE3 poseAt(int i) { return SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.02 * i, 0.01 * i, 0)); }

void catchUp(VolumeDistance& distance, const Eigen::Vector3d& p) {
  DistanceStep step;
  for (int i = 0; i < 1000 && !step.caught_up; ++i) distance.step(kNewest, p, {}, step);
  REQUIRE(step.caught_up);
}

struct Flight {
  Flight() : volume(volumeSettings()), integrator(volume, scene.view.camera.pixels()) {}

  void fly(int from, int to, VolumeDistance* distance) {
    for (int i = from; i < to; ++i) {
      VolumeStep step;
      REQUIRE(integrator.step(scene.at(0.1 * i, poseAt(i)), poseAt(i), {}, step).ok());
      if (distance == nullptr) continue;
      DistanceStep out;
      distance->step(Stamp{i}, poseAt(i).translation, {50}, out);
      CHECK(out.blocks <= 50);
    }
  }

  Scene scene;
  VoxelVolume volume;
  VolumeIntegrator integrator;
};

}  // namespace

TEST_CASE("in observed free space the field gives the true distance to within half a voxel") {
  Flight flight;
  DistanceField field(limits());
  VolumeDistance distance(flight.volume, field);
  flight.fly(0, 20, &distance);
  catchUp(distance, poseAt(19).translation);
  int points = 0;
  double worst = 0;
  for (double x = 0.6; x < 1.9; x += 0.043) {
    for (double y = -0.3; y < 0.9; y += 0.051) {
      for (double z = -0.4; z < 0.5; z += 0.057) {
        const Eigen::Vector3d p(x, y, z);
        if (!nearestWasSeen(p)) continue;
        const DistanceSample sample = field.query(p);
        if (sample.space != Space::kFree) continue;
        CHECK_FALSE(sample.stale);
        CHECK(sample.clearance() <= trueDistance(p) + 0.025);
        if (sample.kind != DistanceKind::kDistance) continue;
        ++points;
        worst = std::max(worst, std::abs(sample.distance - trueDistance(p)));
      }
    }
  }
  CHECK(points > 1000);
  CHECK(worst < 0.025);
}

TEST_CASE("the gradient leads away from the ball") {
  Flight flight;
  DistanceField field(limits());
  VolumeDistance distance(flight.volume, field);
  flight.fly(0, 20, &distance);
  catchUp(distance, poseAt(19).translation);
  for (const Eigen::Vector3d& way : {Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(-1, 0.4, 0.2)}) {
    const DistanceSample sample = field.query(kBall + (kRadius + 0.2) * way.normalized());
    REQUIRE(sample.kind == DistanceKind::kDistance);
    CHECK(sample.gradient.dot(way.normalized()) > 0.95);
  }
}

TEST_CASE("kept step by step or made from nothing, the distances are the same") {
  Flight flight;
  DistanceField kept(limits());
  VolumeDistance keeping(flight.volume, kept);
  flight.fly(0, 30, &keeping);
  catchUp(keeping, poseAt(29).translation);
  DistanceField anew(limits());
  VolumeDistance making(flight.volume, anew);
  catchUp(making, poseAt(29).translation);
  int compared = 0;
  for (double x = -1; x < 2.1; x += 0.05) {
    for (double y = -1; y < 1; y += 0.05) {
      for (double z = -1; z < 1; z += 0.05) {
        const DistanceSample a = kept.query({x, y, z});
        const DistanceSample b = anew.query({x, y, z});
        REQUIRE(a.space == b.space);
        REQUIRE(a.kind == b.kind);
        REQUIRE(a.known_to == b.known_to);
        REQUIRE(a.distance == b.distance);
        compared += a.kind == DistanceKind::kDistance ? 1 : 0;
      }
    }
  }
  CHECK(compared > 10'000);
}

TEST_CASE("blocks that the volume dropped become unknown") {
  Flight flight;
  DistanceField field(limits());
  VolumeDistance distance(flight.volume, field);
  flight.fly(0, 5, &distance);
  catchUp(distance, poseAt(4).translation);
  const Eigen::Vector3d before_wall(1.9, -0.5, 0);
  REQUIRE(field.query(before_wall).space == Space::kFree);
  flight.volume.clear();
  catchUp(distance, poseAt(4).translation);
  const DistanceSample sample = field.query(before_wall);
  CHECK(sample.kind == DistanceKind::kUnknown);
  CHECK(sample.clearance() == 0);
}
