// Vector lanes against their scalar twins: one landmark eliminated, with and without calibration columns and
// columns of its own, one point's system, on random windows
// with any number of sightings, cameras missing, views behind the camera, linearizations left behind, rolling
// shutters.

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/point_system.hpp"
#include "tests/smoother/scalar_landmark.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::kPixelSigma;
using test::randomVector;

namespace {

constexpr double kTwin = 1e-9;  // relative

// As many states as asked for, poses and whole ones in mixed order of slots.
struct LaneWindow {
  Rig rig = makeRig(RigKind::kEuroc).rig;
  std::array<RigPose, kMaxStates> poses{};
  std::vector<std::uint32_t> slots;  // by time
  std::vector<bool> moved;           // the linearization point is elsewhere
  test::WindowScene scene;

  // Every other one with a rolling shutter.
  LaneWindow(std::size_t count, double share_moved, Random& random) {
    const double readout = random.uniform(0, 1) < 0.5 ? 0.02 : 0;
    scene = test::sceneAround(rig, count, 0.4, random);
    for (std::size_t k = 0; k < count; ++k) {
      slots.push_back(static_cast<std::uint32_t>((7 * k + 3) % kMaxStates));
      moved.push_back(random.uniform(0, 1) < share_moved);
      RigPose& pose = poses[slots[k]] = scene.poses[k];
      const SE3& T = scene.states[k].T_world_body;
      const SE3 then(T.rotation * expSo3(randomVector(random, 0.01)),
                     T.translation + randomVector(random, 0.01));
      const ScanTurn scan{randomVector(random, 2), randomVector(random, 2)};
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        RigPose elsewhere = pose;
        pose.place(c, rig.T_body_cam[c], T, readout, scan);
        elsewhere.place(c, rig.T_body_cam[c], then, readout, scan);
        if (moved[k]) pose.linearization[c] = elsewhere.linearization[c];
      }
    }
  }

  LandmarkViews views(const Landmark& landmark, const CalibrationLayout& layout) const {
    return {landmark.views(), poses, rig.T_body_cam, layout};
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
        const bool used = random.uniform(0, 1) < 0.7;
        const Eigen::Vector3d measured = sign * (expSo3(randomVector(random, 0.004)) * ray.normalized());
        view = CameraSighting::of(measured, test::tangentWeight(measured, 450 / kPixelSigma));
        view.row = static_cast<float>(random.uniform(-0.5, 0.5));
        view.used = used;
        // What is not used must not be read.
        if (!view.used) view.bearing.setConstant(std::numeric_limits<float>::quiet_NaN());
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

struct Reduced {
  bool used = false;
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost = 0;

  // Slots have their columns in order of time, behind the calibration's.
  static std::array<Eigen::Index, kMaxStates> columns(const LaneWindow& window,
                                                      const CalibrationLayout& layout) {
    std::array<Eigen::Index, kMaxStates> at{};
    Eigen::Index next = layout.dimension();
    for (const std::uint32_t slot : window.slots) {
      at[slot] = next;
      next += kPoseDim;
    }
    return at;
  }

  static Reduced lanes(const LaneWindow& window, const Landmark& landmark, const CalibrationLayout& layout) {
    std::array<WindowState, kMaxStates> states{};
    const auto at = columns(window, layout);
    for (const std::uint32_t slot : window.slots) {
      states[slot].used = true;
      states[slot].has_motion = false;
      states[slot].offset = static_cast<int>(at[slot]);
    }
    const int dimension = layout.dimension() + kPoseDim * static_cast<int>(window.slots.size());
    const auto system = std::make_unique<NormalEquations>();
    system->begin(layout, dimension);
    Reduced result;
    result.used = system->addLandmark(window.views(landmark, layout), landmark.point, states);
    system->finish(states);
    result.H = Eigen::MatrixXd(system->H()).triangularView<Eigen::Lower>();
    result.g = system->g();
    result.cost = system->cost();
    return result;
  }

  static Reduced scalar(const LaneWindow& window, const Landmark& landmark, const CalibrationLayout& layout) {
    const Eigen::Index n = layout.dimension() + kPoseDim * static_cast<Eigen::Index>(window.slots.size());
    test::ScalarLandmark twin(n + 3);
    const auto at = columns(window, layout);
    twin.add(window.views(landmark, layout), landmark.point, PointBasis::of(landmark.point.bearing), false,
             at);
    Reduced result;
    result.used = twin.eliminate();
    if (!result.used) {
      result.H = Eigen::MatrixXd::Zero(n, n);
      result.g = Eigen::VectorXd::Zero(n);
      return result;
    }
    result.H = Eigen::MatrixXd(twin.H.topLeftCorner(n, n)).triangularView<Eigen::Lower>();
    result.g = twin.g.head(n);
    result.cost = twin.cost;
    return result;
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
  const PointViews views(poses, sightings);
  const PointSystem lanes = views.linearize(point, basis);
  const PointSystem twin = scalarSystem(poses, sightings, point, basis);
  CHECK(lanes.views == twin.views);
  CHECK(lanes.in_front == twin.in_front);
  CHECK((lanes.H - twin.H).norm() <= kTwin * twin.H.norm());
  CHECK((lanes.g - twin.g).norm() <= kTwin * twin.g.norm());
  CHECK(std::abs(lanes.cost - twin.cost) <= kTwin * twin.cost);
  CHECK(std::abs(views.cost(point) - twin.cost) <= kTwin * twin.cost);
  double squares = 0;
  for (const Sighting& sighting : sightings) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      const CameraSighting& view = sighting.camera[c];
      Eigen::Vector2d r;
      if (!view.used || !reprojectionResidual(view, poses[sighting.slot].current[c], point, r)) continue;
      squares += r.squaredNorm();
    }
  }
  const double mean = meanSquaredResidual(poses, sightings, point);
  if (twin.in_front && twin.views > 0) {
    CHECK(std::abs(mean - squares / twin.views) <= kTwin * mean);
  } else if (!twin.in_front) {
    CHECK(mean > 1e5);  // fits nowhere
  }
}

}  // namespace

TEST_CASE("Lanes: a landmark eliminated in fours equals the scalar elimination", "[smoother][lanes]") {
  Random random(31);
  int eliminated = 0;
  int unused = 0;
  for (std::size_t count = 1; count <= kMaxStates; ++count) {
    for (const double moved : {0.0, 0.4, 1.0}) {
      const LaneWindow window(count, moved, random);
      for (int trial = 0; trial < 4; ++trial) {
        INFO(count << " states, share moved " << moved << ", trial " << trial);
        const Landmark landmark = window.landmark(random);
        // With the time offset, both cameras' extrinsics, both and the readout, none.
        const CalibrationLayout layout{trial % 2 == 1, trial >= 2, window.rig.camera_count, trial == 3};
        const Reduced lanes = Reduced::lanes(window, landmark, layout);
        const Reduced twin = Reduced::scalar(window, landmark, layout);
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

TEST_CASE("Lanes: a landmark that keeps its columns equals the scalar sum", "[smoother][lanes]") {
  Random random(34);
  for (std::size_t count = 1; count <= kMaxStates; ++count) {
    const LaneWindow window(count, 0.4, random);
    for (int trial = 0; trial < 4; ++trial) {
      INFO(count << " states, trial " << trial);
      const CalibrationLayout layout{trial % 2 == 1, trial >= 2, window.rig.camera_count, trial == 3};
      const Landmark landmark = window.landmark(random);
      const Eigen::Vector3d p = landmark.point.reference + 3 * landmark.point.bearing;
      // The point's columns stand before the poses.
      std::array<WindowState, kMaxStates> states{};
      std::array<Eigen::Index, kMaxStates> at = Reduced::columns(window, layout);
      const int dimension = layout.dimension() + kPoseDim * static_cast<int>(window.slots.size()) + 3;
      for (const std::uint32_t slot : window.slots) states[slot].offset = static_cast<int>(at[slot]) + 3;
      const auto system = std::make_unique<NormalEquations>();
      system->begin(layout, dimension);
      system->addExplicitLandmark(window.views(landmark, layout), p, layout.dimension(), states);
      system->finish(states);
      test::ScalarLandmark twin(dimension);
      LandmarkPoint point;
      point.bearing = Eigen::Vector3d::UnitX();
      point.inverse_depth = 0.5;
      point.reference = p - 2 * point.bearing;
      twin.add(window.views(landmark, layout), point, {}, true, at);
      const Eigen::Index k = layout.dimension();
      const Eigen::Index n = dimension - 3 - k;
      Eigen::VectorXi order(dimension);  // twin's columns, in the system's order
      for (Eigen::Index i = 0; i < dimension; ++i) {
        order[i] = static_cast<int>(i < k ? i : (i < k + 3 ? k + n + (i - k) : i - 3));
      }
      const Eigen::MatrixXd expected = twin.H(order, order).triangularView<Eigen::Lower>();
      const Eigen::MatrixXd H = Eigen::MatrixXd(system->H()).triangularView<Eigen::Lower>();
      CHECK((H - expected).norm() <= kTwin * expected.norm());
      CHECK((system->g() - twin.g(order)).norm() <= kTwin * twin.g.norm());
      CHECK(std::abs(system->cost() - twin.cost) <= kTwin * twin.cost);
    }
  }
}

TEST_CASE("Lanes: a point's system equals the scalar sum", "[smoother][lanes]") {
  Random random(32);
  for (std::size_t count = 1; count <= kMaxStates; ++count) {
    const LaneWindow window(count, 0.4, random);
    for (int trial = 0; trial < 4; ++trial) {
      INFO(count << " states, trial " << trial);
      const Landmark landmark = window.landmark(random);
      checkPointSystem(window.poses, landmark.views(), landmark.point);
    }
  }
}

TEST_CASE("Lanes: a point seen more often than a window holds, as in full smoothing", "[smoother][lanes]") {
  Random random(33);
  const LaneWindow window(kMaxStates, 0, random);
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
