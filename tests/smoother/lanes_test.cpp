// Vector lanes against their scalar twins: one landmark eliminated, one point's system, on random windows
// with any number of sightings, cameras missing, views behind the camera, linearizations left behind.

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/point_system.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::randomVector;

namespace {

constexpr double kTwin = 1e-9;  // relative
constexpr double kPixelSigma = 0.6;

// As many states as asked for, poses and whole ones in mixed order of slots.
struct Window {
  Rig rig = makeRig(RigKind::kEuroc).rig;
  std::array<RigPose, kMaxStates> poses{};
  std::vector<std::uint32_t> slots;  // by time
  std::vector<bool> frozen;
  test::WindowScene scene;

  Window(std::size_t count, double share_frozen, Random& random) {
    scene = test::sceneAround(rig, count, 0.4, random);
    for (std::size_t k = 0; k < count; ++k) {
      slots.push_back(static_cast<std::uint32_t>((7 * k + 3) % kMaxStates));
      frozen.push_back(random.uniform(0, 1) < share_frozen);
      RigPose& pose = poses[slots[k]] = scene.poses[k];
      if (!frozen[k]) continue;
      const SE3& T = scene.states[k].T_world_body;
      const SE3 then(T.rotation * expSo3(randomVector(random, 0.01)),
                     T.translation + randomVector(random, 0.01));
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        pose.linearization[c] = CameraPose::of(then, rig.T_body_cam[c]);
      }
    }
  }

  // Seen by every state; then views are taken out, and some are turned to where the point is behind them.
  Landmark landmark(Random& random) const {
    Landmark result;
    const Eigen::Vector3d p = scene.inSight(rig, random.uniform(1.0, 8.0), random);
    const double behind = random.uniform(0, 1) < 0.5 ? 0.15 : 0.0;
    for (std::size_t k = 0; k < slots.size(); ++k) {
      Sighting sighting;
      sighting.slot = slots[k];
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        CameraSighting& view = sighting.camera[c];
        const Eigen::Vector3d ray = (scene.states[k].T_world_body * rig.T_body_cam[c]).inverse() * p;
        const double sign = random.uniform(0, 1) < behind ? -1 : 1;
        view.used = random.uniform(0, 1) < 0.7;
        view.bearing = sign * (expSo3(randomVector(random, 0.004)) * ray.normalized());
        view.weight = test::tangentWeight(view.bearing, 450 / kPixelSigma);
        // What is not used must not be read.
        if (!view.used) view.bearing.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      if (!sighting.camera[0].used && !sighting.camera[1].used) continue;
      static_cast<void>(result.sightings.tryPushBack(sighting));
    }
    LandmarkPoint& point = result.point;
    point.triangulated = true;
    point.reference = scene.poses[0].current[0].center + randomVector(random, 0.1);
    point.bearing = (p - point.reference).normalized();
    point.inverse_depth = random.uniform(0, 1) < 0.1 ? 0 : 1.0 / (p - point.reference).norm();
    return result;
  }
};

// The window's system of one landmark. With a time offset, whose column comes first, it is the scalar code.
struct Reduced {
  bool used = false;
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost = 0;

  Reduced(const Window& window, const Landmark& landmark, bool scalar) {
    CalibrationLayout layout;
    layout.time_offset = scalar;
    layout.cameras = kMaxCameras;
    std::array<WindowState, kMaxStates> states{};
    int dimension = layout.dimension();
    for (std::size_t k = 0; k < window.slots.size(); ++k) {
      WindowState& state = states[window.slots[k]];
      state.used = true;
      state.has_motion = k % 3 == 2;
      state.offset = dimension;
      dimension += state.dimension();
    }
    const auto system = std::make_unique<NormalEquations>();
    system->begin(layout, dimension);
    used = system->addLandmark(landmark, window.poses, window.rig.T_body_cam, states);
    system->finish(states);
    const Eigen::Index n = dimension - layout.dimension();
    H = Eigen::MatrixXd(system->H()).bottomRightCorner(n, n).triangularView<Eigen::Lower>();
    g = system->g().tail(n);
    cost = system->cost();
  }
};

PointSystem scalarSystem(RigPoses poses, std::span<const Sighting> sightings, const LandmarkPoint& point,
                         const PointBasis& basis) {
  PointSystem system;
  for (const Sighting& sighting : sightings) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      if (!sighting.camera[c].used) continue;
      Eigen::Vector2d r;
      SightingJacobians J;
      const CameraPose& camera = poses[sighting.slot].current[c];
      if (!reprojectionResidual(sighting.camera[c], camera, point, r)) {
        system.in_front = false;
        continue;
      }
      REQUIRE(reprojectionJacobians(sighting.camera[c], camera, SE3(), point, basis, false, J));
      const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
      system.H += robust.weight * J.point.transpose() * J.point;
      system.g += robust.weight * J.point.transpose() * r;
      system.cost += robust.cost;
      ++system.views;
    }
  }
  return system;
}

void checkPointSystem(RigPoses poses, std::span<const Sighting> sightings, const LandmarkPoint& point) {
  const PointBasis basis = PointBasis::of(point.bearing);
  const PointSystem lanes = PointViews(poses, sightings).linearize(point, basis);
  const PointSystem twin = scalarSystem(poses, sightings, point, basis);
  CHECK(lanes.views == twin.views);
  CHECK(lanes.in_front == twin.in_front);
  CHECK((lanes.H - twin.H).norm() <= kTwin * twin.H.norm());
  CHECK((lanes.g - twin.g).norm() <= kTwin * twin.g.norm());
  CHECK(std::abs(lanes.cost - twin.cost) <= kTwin * twin.cost);
}

}  // namespace

TEST_CASE("Lanes: a landmark eliminated in fours equals the scalar elimination", "[smoother][lanes]") {
  Random random(31);
  int eliminated = 0;
  int unused = 0;
  for (std::size_t count = 1; count <= kMaxStates; ++count) {
    for (const double frozen : {0.0, 0.4, 1.0}) {
      const Window window(count, frozen, random);
      for (int trial = 0; trial < 4; ++trial) {
        INFO(count << " states, share frozen " << frozen << ", trial " << trial);
        const Landmark landmark = window.landmark(random);
        const Reduced lanes(window, landmark, false);
        const Reduced twin(window, landmark, true);
        REQUIRE(lanes.used == twin.used);
        CHECK((lanes.H - twin.H).norm() <= kTwin * twin.H.norm());
        CHECK((lanes.g - twin.g).norm() <= kTwin * twin.g.norm());
        CHECK(std::abs(lanes.cost - twin.cost) <= kTwin * twin.cost);
        ++(lanes.used ? eliminated : unused);
      }
    }
  }
  // Both happen, else the comparison is empty.
  CHECK(eliminated > 200);
  CHECK(unused > 5);
}

TEST_CASE("Lanes: a point's system equals the scalar sum", "[smoother][lanes]") {
  Random random(32);
  for (std::size_t count = 1; count <= kMaxStates; ++count) {
    const Window window(count, 0.4, random);
    for (int trial = 0; trial < 4; ++trial) {
      INFO(count << " states, trial " << trial);
      const Landmark landmark = window.landmark(random);
      checkPointSystem(window.poses, landmark.views(), landmark.point);
    }
  }
}

TEST_CASE("Lanes: a point seen more often than a window holds, as in full smoothing", "[smoother][lanes]") {
  Random random(33);
  const Window window(kMaxStates, 0, random);
  for (const std::size_t count : {kMaxStates + 1, 3 * kMaxStates + 2, std::size_t{400}}) {
    const LandmarkPoint point = window.landmark(random).point;
    std::vector<Sighting> sightings;
    while (sightings.size() < count) {
      const Landmark landmark = window.landmark(random);
      sightings.insert(sightings.end(), landmark.sightings.begin(), landmark.sightings.end());
    }
    sightings.resize(count);
    INFO(count << " sightings");
    checkPointSystem(window.poses, sightings, point);
  }
}
