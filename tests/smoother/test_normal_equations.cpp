// The reduced system against the dense one that still holds every landmark, solved with Eigen.

#include "estimator/smoother/normal_equations.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::kPixelSigma;
using test::numericJacobian;
using test::randomVector;

namespace {

// Of the elimination, written here once more: weak information on the inverse depth, relative damping.
constexpr double kDepthInformation = 1.0 / (30.0 * 30.0);
constexpr double kPointDamping = 1e-9;
// Slots in order of time: a window that has run for a while is not sorted.
constexpr std::array<std::uint8_t, 6> kSlots{5, 0, 17, 3, 23, 9};
constexpr std::size_t kPoseOnly = 2;  // states that are poses only

struct SystemWindow {
  Rig rig = makeRig(RigKind::kEuroc).rig;
  CalibrationLayout calibration;
  std::array<WindowState, kMaxStates> states{};
  std::array<RigPose, kMaxStates> poses{};
  std::vector<SE3> T_world_body;  // by time, where the rig was placed
  std::vector<SE3> T_lin;
  std::vector<Landmark> landmarks;
  int dimension = 0;

  // Linearization poses differ from the current ones by `moved` [m, rad].
  SystemWindow(bool time_offset, bool extrinsics, double moved, Random& random) {
    calibration = {time_offset, extrinsics, rig.camera_count};
    const test::WindowScene scene = test::sceneAround(rig, kSlots.size(), 0.4, random);
    dimension = calibration.dimension();
    for (std::size_t k = 0; k < kSlots.size(); ++k) {
      WindowState& state = states[kSlots[k]];
      state.used = true;
      state.x = scene.states[k];
      state.has_motion = k >= kPoseOnly;
      state.offset = dimension;
      dimension += state.dimension();
      poses[kSlots[k]] = scene.poses[k];
      T_world_body.push_back(state.x.T_world_body);
      T_lin.push_back(SE3(state.x.T_world_body.rotation * expSo3(randomVector(random, moved)),
                          state.x.T_world_body.translation + randomVector(random, moved)));
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        poses[kSlots[k]].linearization[c] = CameraPose::of(T_lin[k], rig.T_body_cam[c]);
      }
    }
    for (std::size_t m = 0; m < 40; ++m) addLandmark(scene, m, random);
  }

  void addLandmark(const test::WindowScene& scene, std::size_t m, Random& random) {
    const Eigen::Vector3d p = scene.inSight(rig, random.uniform(1.0, 8.0), random);
    // Some pixels are far off, so that robust weights take part.
    const double noise = m % 5 == 0 ? 6.0 : 1.0;
    std::vector<Sighting> seen = scene.sightings(rig, p, kPixelSigma, noise, random);
    Landmark landmark;
    landmark.point.triangulated = true;
    landmark.point.reference = scene.poses[0].current[0].center;
    const Eigen::Vector3d ray = p - landmark.point.reference;
    landmark.point.bearing = ray.normalized();
    landmark.point.inverse_depth = m % 7 == 0 ? 0.01 : 1.0 / ray.norm();
    for (std::size_t k = 0; k < seen.size(); ++k) {
      if ((k + m) % 4 == 3) continue;  // not every state sees every landmark
      if ((k + m) % 3 == 1) seen[k].camera[1].used = false;
      seen[k].slot = kSlots[seen[k].slot];
      static_cast<void>(landmark.sightings.tryPushBack(seen[k]));
    }
    if (landmark.sightings.size() >= 2) landmarks.push_back(landmark);
  }

  [[nodiscard]] LandmarkViews views(const Landmark& landmark) const {
    return {landmark.views(), poses, rig.T_body_cam, calibration};
  }

  [[nodiscard]] std::size_t timeOf(std::uint32_t slot) const {
    return static_cast<std::size_t>(std::find(kSlots.begin(), kSlots.end(), slot) - kSlots.begin());
  }
};

struct Dense {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost = 0;
};

// Residual of one sighting with the image's stamp off by `shift` [s] and the linearization pose.
Eigen::Vector2d shifted(const SystemWindow& w, const CameraSighting& view, std::size_t k, std::size_t c,
                        const LandmarkPoint& point, double shift) {
  const RigPose& rig = w.poses[kSlots[k]];
  const SE3 T(w.T_lin[k].rotation * expSo3(shift * rig.omega_body),
              w.T_lin[k].translation + shift * rig.v_world);
  Eigen::Vector2d r;
  REQUIRE(reprojectionResidual(view, CameraPose::of(T, w.rig.T_body_cam[c]), point, r));
  return r;
}

// Jacobian of one sighting over calibration, states and its landmark's three columns.
Eigen::MatrixXd denseRow(const SystemWindow& w, const CameraSighting& view, std::uint32_t slot, std::size_t c,
                         const LandmarkPoint& point, const PointBasis& basis, Eigen::Index landmark_column,
                         Eigen::Index columns) {
  const std::size_t k = w.timeOf(slot);
  SightingJacobians J;
  REQUIRE(reprojectionJacobians(view, w.poses[slot].linearization[c], w.rig.T_body_cam[c], point, basis, true,
                                J));
  Eigen::MatrixXd row = Eigen::MatrixXd::Zero(2, columns);
  row.middleCols<6>(w.states[slot].offset) = J.pose;
  row.middleCols<3>(landmark_column) = J.point;
  if (w.calibration.time_offset) {
    const double h = 1e-5;
    row.col(0) = (shifted(w, view, k, c, point, h) - shifted(w, view, k, c, point, -h)) / (2 * h);
  }
  if (w.calibration.extrinsics) row.middleCols<6>(w.calibration.extrinsicOffset(c)) = J.extrinsic;
  return row;
}

Dense denseSystem(const SystemWindow& w) {
  const Eigen::Index n = w.dimension + 3 * static_cast<Eigen::Index>(w.landmarks.size());
  Dense dense{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), 0};
  for (std::size_t m = 0; m < w.landmarks.size(); ++m) {
    const Landmark& landmark = w.landmarks[m];
    const PointBasis basis = PointBasis::of(landmark.point.bearing);
    const Eigen::Index column = w.dimension + 3 * static_cast<Eigen::Index>(m);
    for (const Sighting& sighting : landmark.sightings) {
      for (std::size_t c = 0; c < w.rig.camera_count; ++c) {
        const CameraSighting& view = sighting.camera[c];
        Eigen::Vector2d r;
        if (!view.used) continue;
        REQUIRE(reprojectionResidual(view, w.poses[sighting.slot].current[c], landmark.point, r));
        const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
        const Eigen::MatrixXd J = denseRow(w, view, sighting.slot, c, landmark.point, basis, column, n);
        dense.H += robust.weight * J.transpose() * J;
        dense.g += robust.weight * J.transpose() * r;
        dense.cost += robust.cost;
      }
    }
    dense.H(column + 2, column + 2) += kDepthInformation;
    for (Eigen::Index i = 0; i < 3; ++i) dense.H(column + i, column + i) *= 1.0 + kPointDamping;
  }
  return dense;
}

// Information that makes the system regular, as prior and IMU factors would.
double regularization(Eigen::Index column) { return 10.0 + static_cast<double>(column % 7); }

void checkAgainstDense(const SystemWindow& w) {
  auto system = std::make_unique<NormalEquations>();
  system->begin(w.calibration, w.dimension);
  std::vector<EliminatedPoint> eliminated(w.landmarks.size());
  for (std::size_t i = 0; i < w.landmarks.size(); ++i) {
    REQUIRE(system->addLandmark(w.views(w.landmarks[i]), w.landmarks[i].point, w.states, &eliminated[i]));
  }
  system->finish(w.states);
  Dense dense = denseSystem(w);
  CHECK(system->cost() == Approx(dense.cost).epsilon(1e-12));

  const Eigen::Index n = w.dimension;
  const Eigen::Index m = dense.H.rows() - n;
  const Eigen::MatrixXd B = dense.H.topRightCorner(n, m);
  const Eigen::LDLT<Eigen::MatrixXd> points(dense.H.bottomRightCorner(m, m));
  const Eigen::MatrixXd expected_H = dense.H.topLeftCorner(n, n) - B * points.solve(B.transpose());
  const Eigen::VectorXd expected_g = dense.g.head(n) - B * points.solve(dense.g.tail(m));
  const MatrixMap H = system->H();
  double worst = 0;
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = c; r < n; ++r) worst = std::max(worst, std::abs(H(r, c) - expected_H(r, c)));
  }
  const double scale = dense.H.topLeftCorner(n, n).cwiseAbs().maxCoeff();
  CHECK(worst < 1e-8 * scale);
  CHECK((system->g() - expected_g).norm() < 1e-8 * dense.g.head(n).norm());

  // The step: what a solver of the whole, un-eliminated system finds.
  for (Eigen::Index k = 0; k < n; ++k) {
    dense.H(k, k) += regularization(k);
    system->H()(k, k) += regularization(k);
  }
  const Eigen::VectorXd full = dense.H.ldlt().solve(-dense.g);
  Eigen::VectorXd step = -system->g();
  REQUIRE(choleskyInPlace(system->H()));
  choleskySolve(system->H(), VectorMap(step.data(), n));
  CHECK((step - full.head(n)).norm() < 1e-6 * full.head(n).norm());

  // Back-substitution: the points' part, to single precision.
  Eigen::VectorXd points_step(m);
  const StepOfStates of_states(VectorMap(step.data(), n), w.states, w.calibration.dimension());
  for (std::size_t i = 0; i < eliminated.size(); ++i) {
    points_step.segment<3>(3 * static_cast<Eigen::Index>(i)) = eliminated[i].step(of_states);
  }
  CHECK((points_step - full.tail(m)).norm() < 1e-5 * full.tail(m).norm());
}

}  // namespace

TEST_CASE("Eliminating landmarks leaves the solution of the whole system", "[smoother][normal_equations]") {
  Random random(21);
  for (int trial = 0; trial < 3; ++trial) {
    INFO("trial " << trial);
    checkAgainstDense(SystemWindow(false, false, 0, random));
    checkAgainstDense(SystemWindow(false, false, 0.02, random));
  }
}

TEST_CASE("Eliminating landmarks with calibration columns", "[smoother][normal_equations]") {
  Random random(22);
  for (const double moved : {0.0, 0.02}) {
    INFO("linearization moved by " << moved);
    checkAgainstDense(SystemWindow(true, false, moved, random));
    checkAgainstDense(SystemWindow(false, true, moved, random));
    checkAgainstDense(SystemWindow(true, true, moved, random));
  }
}

TEST_CASE("A landmark needs two states", "[smoother][normal_equations]") {
  Random random(23);
  SystemWindow w(false, false, 0, random);
  auto system = std::make_unique<NormalEquations>();
  system->begin(w.calibration, w.dimension);
  Landmark landmark = w.landmarks[0];
  while (landmark.sightings.size() > 1) landmark.sightings.popBack();
  CHECK_FALSE(system->addLandmark(w.views(landmark), landmark.point, w.states));
  landmark.sightings.clear();
  CHECK_FALSE(system->addLandmark(w.views(landmark), landmark.point, w.states));
  system->finish(w.states);
  CHECK(system->H().cwiseAbs().maxCoeff() == 0);
  CHECK(system->g().cwiseAbs().maxCoeff() == 0);
  CHECK(system->cost() == 0);
}

TEST_CASE("Motion and diagonal factors land in their columns", "[smoother][normal_equations]") {
  Random random(24);
  SystemWindow w(true, false, 0, random);
  auto system = std::make_unique<NormalEquations>();
  const WindowState& i = w.states[kSlots[3]];
  const WindowState& j = w.states[kSlots[4]];
  MotionFactor factor;
  for (int k = 0; k < 15; ++k) factor.residual[k] = random.normal();
  for (int k = 0; k < 225; ++k) {
    factor.jacobian_i.data()[k] = random.normal();
    factor.jacobian_j.data()[k] = random.normal();
  }
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(15, w.dimension);
  J.middleCols<15>(i.offset) = factor.jacobian_i;
  J.middleCols<15>(j.offset) = factor.jacobian_j;
  Eigen::MatrixXd H = J.transpose() * J;
  Eigen::VectorXd g = J.transpose() * factor.residual;
  const Eigen::Vector3d deviation(0.1, -0.2, 0.3);
  const double sigma = 0.05;
  H.diagonal().segment<3>(j.offset + 6).array() += 1 / (sigma * sigma);
  g.segment<3>(j.offset + 6) += deviation / (sigma * sigma);
  const double cost = 0.5 * factor.residual.squaredNorm() + 0.5 * deviation.squaredNorm() / (sigma * sigma);
  // Either order of the two states in the columns.
  for (const bool swapped : {false, true}) {
    system->begin(w.calibration, w.dimension);
    if (swapped) {
      MotionFactor turned = factor;
      std::swap(turned.jacobian_i, turned.jacobian_j);
      system->addMotion(turned, j, i);
    } else {
      system->addMotion(factor, i, j);
    }
    system->addDiagonal(j, 6, deviation, sigma);
    system->finish(w.states);
    Eigen::MatrixXd lower = system->H();
    lower.triangularView<Eigen::StrictlyUpper>().setZero();
    Eigen::MatrixXd expected = H;
    expected.triangularView<Eigen::StrictlyUpper>().setZero();
    CHECK((lower - expected).cwiseAbs().maxCoeff() < 1e-9);
    CHECK((system->g() - g).norm() < 1e-9);
    CHECK(system->cost() == Approx(cost));
  }
}

TEST_CASE("Eliminated landmarks do not see position and yaw, wherever the states have moved to",
          "[smoother][normal_equations]") {
  Random random(25);
  for (const double moved : {0.0, 0.05}) {
    INFO("current poses off the linearization by " << moved);
    const SystemWindow w(false, false, moved, random);
    auto system = std::make_unique<NormalEquations>();
    system->begin(w.calibration, w.dimension);
    for (const Landmark& landmark : w.landmarks) {
      REQUIRE(system->addLandmark(w.views(landmark), landmark.point, w.states));
    }
    system->finish(w.states);
    const Eigen::MatrixXd H = Eigen::MatrixXd(system->H()).selfadjointView<Eigen::Lower>();
    Eigen::MatrixXd N = Eigen::MatrixXd::Zero(w.dimension, 6);
    Eigen::MatrixXd wrong = N;  // the same directions at the current poses
    for (std::size_t k = 0; k < kSlots.size(); ++k) {
      const int at = w.states[kSlots[k]].offset;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d e = Eigen::Vector3d::Unit(axis);
        N.block<3, 1>(at + 3, axis) = e;
        N.block<3, 1>(at, 3 + axis) = w.T_lin[k].rotation.conjugate() * e;
        N.block<3, 1>(at + 3, 3 + axis) = e.cross(w.T_lin[k].translation);
        wrong.block<3, 1>(at, 3 + axis) = w.T_world_body[k].rotation.conjugate() * e;
        wrong.block<3, 1>(at + 3, 3 + axis) = e.cross(w.T_world_body[k].translation);
      }
    }
    // Vision alone sees neither position nor attitude. What is left comes from the weak information on
    // the inverse depth and the points' damping: nine orders below the information in other directions.
    const double left = (N.transpose() * H * N).diagonal().cwiseAbs().maxCoeff();
    CHECK(left < 1e-6 * H.diagonal().maxCoeff());
    if (moved > 0) CHECK((wrong.transpose() * H * wrong).diagonal().maxCoeff() > 1e3 * left);
  }
}
