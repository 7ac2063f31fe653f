// Planes as a manifold; the factors of extra states against numeric differentiation; explicit landmarks
// against eliminated ones.

#include "estimator/smoother/extra_factors.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "estimator/smoother/elimination.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::kPixelSigma;
using test::numericJacobian;
using test::randomVector;
using test::relativeDifference;

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

Plane randomPlane(Random& random) { return {randomVector(random, 1), 3 * random.normal()}; }

ExtraState planeState(const Plane& plane, int offset) {
  ExtraState state;
  state.kind = ExtraKind::kPlane;
  state.x.plane = plane;
  state.offset = offset;
  return state;
}

ExtraState pointState(const Eigen::Vector3d& p, int offset) {
  ExtraState state;
  state.kind = ExtraKind::kLandmark;
  state.x.point = p;
  state.offset = offset;
  return state;
}

ExtraState moved(const ExtraState& state, const Eigen::Vector3d& delta) {
  ExtraState result = state;
  result.retract(delta);
  return result;
}

/// The factor's columns [offset, offset + count), zero where it has none.
Eigen::MatrixXd jacobianOf(const LinearFactor& linear, int offset, int count) {
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(LinearFactor::kMaxRows, count);
  for (int c = 0; c < linear.columns; ++c) {
    const int column = linear.column[static_cast<std::size_t>(c)] - offset;
    if (column >= 0 && column < count) J.col(column) = linear.jacobian.col(c);
  }
  return J;
}

// Residuals written once more, not whitened by the robust weight.
Eigen::Vector3d plainResidual(const ExtraFactor& factor, const ExtraState& plane, const ExtraState& point) {
  const Eigen::Vector3d n = plane.x.plane.normal();
  switch (factor.kind) {
    case ExtraFactorKind::kPointOnPlane:
      return {(n.dot(point.x.point) - plane.x.plane.distance()) / factor.sigma, 0, 0};
    case ExtraFactorKind::kHorizontalPlane:
      return {n.x() / factor.sigma, n.y() / factor.sigma, 0};
    case ExtraFactorKind::kVerticalPlane:
      return {n.z() / factor.sigma, 0, 0};
  }
  return Eigen::Vector3d::Zero();
}

const auto kPlusExtra = [](const ExtraState& x, const Eigen::Vector3d& delta) { return moved(x, delta); };
const auto kMinusVector = [](const auto& value, const auto& reference) { return (value - reference).eval(); };

}  // namespace

TEST_CASE("Plane: retract and minus undo each other", "[smoother][plane]") {
  Random random(51);
  for (int trial = 0; trial < 200; ++trial) {
    const Plane x = randomPlane(random);
    CHECK(x.normal().norm() == Approx(1).margin(1e-14));
    CHECK((x.basis().transpose() * x.normal()).norm() < 1e-14);
    CHECK((x.basis().transpose() * x.basis() - Eigen::Matrix2d::Identity()).norm() < 1e-13);
    Eigen::Vector3d delta = randomVector(random, trial % 2 == 0 ? 0.8 : 1e-9);
    if (delta.head<2>().norm() > 3.1) delta.head<2>() *= 3.1 / delta.head<2>().norm();
    Plane y = x;
    y.retract(delta);
    CHECK((y.minus(x) - delta).norm() < 1e-11 * std::max(1.0, delta.norm()));
    // The angle between the normals is the tangent step's length.
    CHECK(std::acos(std::clamp(x.normal().dot(y.normal()), -1.0, 1.0)) ==
          Approx(delta.head<2>().norm()).margin(1e-7));
    const Plane z = randomPlane(random);
    Plane to_z = x;
    to_z.retract(z.minus(x));
    CHECK((to_z.normal() - z.normal()).norm() < 1e-11);
    CHECK(to_z.distance() == Approx(z.distance()));
  }
}

TEST_CASE("Plane: the tangent basis is the derivative of the normal and never jumps", "[smoother][plane]") {
  Random random(52);
  for (int trial = 0; trial < 50; ++trial) {
    const Plane x = randomPlane(random);
    const auto normal = [](const Plane& plane) { return plane.normal(); };
    const auto plus = [](Plane plane, const Eigen::Vector3d& delta) {
      plane.retract(delta);
      return plane;
    };
    const auto J = numericJacobian<3, 3>(normal, x, plus, kMinusVector);
    CHECK(relativeDifference(J.leftCols<2>(), x.basis()) < 1e-8);
    CHECK(J.col(2).norm() == 0);
  }
  Plane plane(Eigen::Vector3d::UnitX(), 0);
  for (int step = 0; step < 700; ++step) {  // once around, through both poles
    const Eigen::Matrix<double, 3, 2> before = plane.basis();
    plane.retract({0.007, 0.006, 0});
    CHECK((plane.basis() - before).norm() < 0.02);
  }
}

TEST_CASE("Plane: opposite normals, any length", "[smoother][plane]") {
  CHECK((Plane({0, 0, 5}, 1).normal() - Eigen::Vector3d::UnitZ()).norm() < 1e-15);
  CHECK((Plane({0, 0, -2}, 1).normal() + Eigen::Vector3d::UnitZ()).norm() < 1e-15);
  const Eigen::Vector3d turn = Plane({0, 0, -1}, 2).minus(Plane({0, 0, 1}, 1));
  CHECK(turn.head<2>().norm() == Approx(std::numbers::pi));
  CHECK(turn.z() == Approx(1));
}

TEST_CASE("Plane factors: Jacobians numerically, residual at the values", "[smoother][extra]") {
  Random random(54);
  for (int trial = 0; trial < 60; ++trial) {
    const auto kind = static_cast<ExtraFactorKind>(trial % 3);
    const ExtraFactor factor{kind, 0, 0, 0.1};
    const ExtraState plane = planeState(randomPlane(random), 7);
    const ExtraState point = pointState(randomVector(random, 2), 2);
    LinearFactor linear;
    linearize(factor, plane, point, linear);
    const Eigen::Vector3d r = plainResidual(factor, plane, point);
    const double scale = kind == ExtraFactorKind::kHorizontalPlane ? kInformationScale : 1.099;
    const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm(), scale);
    const double root = std::sqrt(robust.weight);
    CHECK((linear.residual - root * r).norm() < 1e-12 * std::max(1.0, r.norm()));
    CHECK(linear.cost == Approx(robust.cost));
    const auto by_plane =
        numericJacobian<3, 3>([&](const ExtraState& x) { return plainResidual(factor, x, point); }, plane,
                              kPlusExtra, kMinusVector);
    const auto by_point =
        numericJacobian<3, 3>([&](const ExtraState& x) { return plainResidual(factor, plane, x); }, point,
                              kPlusExtra, kMinusVector);
    CHECK(relativeDifference(jacobianOf(linear, 7, 3), root * by_plane) < 1e-7);
    CHECK(relativeDifference(jacobianOf(linear, 2, 3), root * by_point) < 1e-7);
  }
}

TEST_CASE("Plane factors do not see shifts of the world and turns about gravity", "[smoother][extra]") {
  Random random(55);
  for (int trial = 0; trial < 60; ++trial) {
    const auto kind = static_cast<ExtraFactorKind>(trial % 3);
    const ExtraFactor factor{kind, 0, 0, 0.1};
    const ExtraState plane = planeState(randomPlane(random), 3);
    const ExtraState point = pointState(randomVector(random, 2), 0);
    LinearFactor linear;
    linearize(factor, plane, point, linear);
    const Plane& at = plane.x.plane;
    const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
    Eigen::Matrix<double, 6, 4> N = Eigen::Matrix<double, 6, 4>::Zero();
    N.topLeftCorner<3, 3>().setIdentity();
    N.block<1, 3>(5, 0) = at.normal().transpose();
    N.block<3, 1>(0, 3) = z.cross(point.x.point);
    N.block<2, 1>(3, 3) = at.basis().transpose() * z.cross(at.normal());
    const Eigen::MatrixXd seen = jacobianOf(linear, 0, 6) * N;
    CHECK(seen.leftCols(3).norm() < 1e-12 * 10);
    if (kind != ExtraFactorKind::kHorizontalPlane) {
      CHECK(seen.col(3).norm() < 1e-11);
    } else {
      const double sine = at.normal().head<2>().norm();
      CHECK(seen.col(3).norm() <= std::sqrt(kInformationScale) * sine / factor.sigma + 1e-12);
    }
  }
}

TEST_CASE("The robust weight of one dimension has the information of the estimate", "[smoother][extra]") {
  // E[psi']^2 / (E[psi^2] E[w]) = 1 for the scaled weight: the scale, by quadrature.
  double slope = 0;
  double square = 0;
  double weight = 0;
  const double h = 1e-3;
  for (double r = -10; r < 10; r += h) {
    const double density = std::exp(-0.5 * r * r) / std::sqrt(2 * std::numbers::pi) * h;
    const auto psi = [](double x) { return x * RobustWeight::cauchy(x * x, 1).weight; };
    slope += density * (psi(r + 1e-5) - psi(r - 1e-5)) / 2e-5;
    square += density * psi(r) * psi(r);
    weight += density * RobustWeight::cauchy(r * r, 1).weight;
  }
  CHECK(slope * slope / (square * weight) == Approx(1.099).margin(5e-4));
}

namespace {

Eigen::Vector2d sightingResidual(const CameraSighting& view, const BodyState& x, const SE3& T_body_cam,
                                 const Eigen::Vector3d& p) {
  const Eigen::Vector3d h = T_body_cam.inverse() * (x.T_world_body.inverse() * p);
  return view.whitening() * h / view.ray().dot(h);
}

}  // namespace

TEST_CASE("Sightings of an explicit landmark: information and gradient numerically, calibration included",
          "[smoother][extra]") {
  Random random(56);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  const CalibrationLayout calibration{true, true, rig.camera_count};
  const int point_offset = calibration.dimension();
  const int pose_offset = point_offset + kExtraDim;
  const int dimension = pose_offset + kPoseDim;
  const auto system = std::make_unique<NormalEquations>();
  for (int trial = 0; trial < 20; ++trial) {
    test::WindowScene scene = test::sceneAround(rig, 1, 0.3, random);
    const Eigen::Vector3d p = scene.inSight(rig, random.uniform(1.0, 6.0), random);
    const std::vector<Sighting> seen = scene.sightings(rig, p, kPixelSigma, 1.0, random);
    if (seen.empty()) continue;
    const ExtraState landmark = pointState(p + randomVector(random, 0.01), point_offset);
    const Eigen::Vector3d& p_at = landmark.x.point;
    const BodyState& x = scene.states[0];
    const RigPose& pose = scene.poses[0];
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(dimension, dimension);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(dimension);
    double cost = 0;
    for (std::size_t c = 0; c < rig.camera_count; ++c) {
      const CameraSighting& view = seen[0].camera[c];
      if (!view.used) continue;
      const SE3& T = rig.T_body_cam[c];
      const Eigen::Vector2d r = sightingResidual(view, x, T, landmark.x.point);
      const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, dimension);
      J.middleCols<kPoseDim>(pose_offset) = numericJacobian<2, 6>(
          [&](const SE3& T_world_body) {
            BodyState y = x;
            y.T_world_body = T_world_body;
            return sightingResidual(view, y, T, p_at);
          },
          x.T_world_body);
      J.middleCols<kExtraDim>(point_offset) = numericJacobian<2, 3>(
          [&](const Eigen::Vector3d& q) { return sightingResidual(view, x, T, q); }, p_at);
      J.middleCols<kPoseDim>(calibration.extrinsicOffset(c)) = numericJacobian<2, 6>(
          [&](const SE3& T_body_cam) { return sightingResidual(view, x, T_body_cam, p_at); }, T);
      J.col(0) =
          J.middleCols<3>(pose_offset) * pose.omega_body + J.middleCols<3>(pose_offset + 3) * pose.v_world;
      H += robust.weight * J.transpose() * J;
      g += robust.weight * J.transpose() * r;
      cost += robust.cost;
    }
    std::array<WindowState, kMaxStates> states{};
    states[0].offset = pose_offset;
    system->begin(calibration, dimension);
    system->addExplicitLandmark({seen, {&pose, 1}, rig.T_body_cam, calibration}, landmark.x.point,
                                point_offset, states);
    system->finish(states);
    const Eigen::MatrixXd lower = H.triangularView<Eigen::Lower>();
    const Eigen::MatrixXd built = Eigen::MatrixXd(system->H()).triangularView<Eigen::Lower>();
    CHECK((built - lower).norm() < 1e-6 * lower.norm());
    CHECK((system->g() - g).norm() < 1e-6 * g.norm());
    CHECK(system->cost() == Approx(cost).epsilon(1e-9));
  }
}

TEST_CASE("A point behind the camera gives no factor", "[smoother][extra]") {
  Random random(57);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  const test::WindowScene scene = test::sceneAround(rig, 1, 0.3, random);
  const Eigen::Vector3d p = scene.inSight(rig, 2.0, random);
  const std::vector<Sighting> seen = scene.sightings(rig, p, kPixelSigma, 0, random);
  REQUIRE(seen.size() == 1);
  const Eigen::Vector3d& centre = scene.poses[0].current[0].center;
  std::array<WindowState, kMaxStates> states{};
  states[0].offset = kExtraDim;
  const auto system = std::make_unique<NormalEquations>();
  for (const bool behind : {false, true}) {
    const Eigen::Vector3d at = behind ? Eigen::Vector3d(2 * centre - p) : p;
    system->begin({}, kExtraDim + kPoseDim);
    system->addExplicitLandmark({seen, scene.poses, rig.T_body_cam, {}}, at, 0, states);
    system->finish(states);
    const Eigen::MatrixXd lower = Eigen::MatrixXd(system->H()).triangularView<Eigen::Lower>();
    CHECK((lower.cwiseAbs().maxCoeff() == 0) == behind);
  }
}

namespace {

/// States on a weak prior with landmarks that all of them see.
struct Bundle {
  Rig rig = makeRig(RigKind::kEuroc).rig;
  std::array<WindowState, kMaxStates> states{};
  std::array<RigPose, kMaxStates> poses{};
  std::vector<BodyState> reference;
  std::vector<Landmark> landmarks;
  std::vector<ExtraState> extras;
  std::size_t count = 5;

  explicit Bundle(Random& random) {
    const test::WindowScene scene = test::sceneAround(rig, count, 0.4, random);
    for (std::size_t k = 0; k < count; ++k) {
      states[k].has_motion = false;
      states[k].x = scene.states[k];
      states[k].x.T_world_body.translation += randomVector(random, 0.01);
      reference.push_back(states[k].x);
    }
    while (landmarks.size() < 30) {
      const Eigen::Vector3d p = scene.inSight(rig, random.uniform(1.5, 5.0), random);
      Landmark landmark;
      for (const Sighting& s : scene.sightings(rig, p, kPixelSigma, 0.8, random)) {
        static_cast<void>(landmark.sightings.tryPushBack(s));
      }
      if (landmark.sightings.size() < 3) continue;
      landmarks.push_back(landmark);
      extras.push_back(pointState(p + randomVector(random, 0.02), 0));
    }
    place();
  }

  void place() {
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        poses[k].current[c] = CameraPose::of(states[k].x.T_world_body, rig.T_body_cam[c]);
      }
      poses[k].linearization = poses[k].current;
    }
  }

  /// One Gauss-Newton step; the length of its longest column.
  double iterate(NormalEquations& system, bool structureless) {
    place();
    int dimension = 0;
    if (!structureless) {
      for (ExtraState& extra : extras) {
        extra.offset = dimension;
        dimension += kExtraDim;
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      states[k].offset = dimension;
      dimension += kPoseDim;
    }
    system.begin({}, dimension);
    for (std::size_t k = 0; k < count; ++k) {
      const Vector15d d = states[k].x.minus(reference[k]);
      system.addDiagonal(states[k], 0, d.segment<3>(0), k == 0 ? 1e-3 : 0.1);
      system.addDiagonal(states[k], 3, d.segment<3>(3), k == 0 ? 1e-3 : 0.1);
    }
    for (std::size_t m = 0; m < landmarks.size(); ++m) {
      if (structureless) {
        REQUIRE(triangulate(poses, landmarks[m].views(), 20, landmarks[m].point));
        REQUIRE(system.addLandmark({landmarks[m].views(), poses, rig.T_body_cam, {}}, landmarks[m].point,
                                   states));
        continue;
      }
      const Eigen::Vector3d& p = extras[m].x.point;
      system.addExplicitLandmark({landmarks[m].views(), poses, rig.T_body_cam, {}}, p, extras[m].offset,
                                 states);
    }
    system.finish(states);
    Eigen::VectorXd step = -system.g();
    REQUIRE(choleskyInPlace(system.H()));
    choleskySolve(system.H(), VectorMap(step.data(), dimension));
    for (std::size_t k = 0; k < count; ++k) {
      Vector15d delta = Vector15d::Zero();
      delta.head<kPoseDim>() = step.segment<kPoseDim>(states[k].offset);
      states[k].x.retract(delta);
    }
    if (!structureless) {
      for (ExtraState& extra : extras) extra.retract(step.segment<kExtraDim>(extra.offset));
    }
    return step.cwiseAbs().maxCoeff();
  }
};

}  // namespace

TEST_CASE("Explicit and structureless landmarks: one system, one solution", "[smoother][extra]") {
  Random random(58);
  Bundle structureless(random);
  Bundle with_columns = structureless;
  auto system = std::make_unique<NormalEquations>();
  double last = 1;
  for (int k = 0; k < 100 && last > 1e-11; ++k) last = structureless.iterate(*system, true);
  REQUIRE(last <= 1e-9);
  const double cost = system->cost();
  last = 1;
  for (int k = 0; k < 100 && last > 1e-11; ++k) last = with_columns.iterate(*system, false);
  REQUIRE(last <= 1e-9);
  CHECK(system->cost() == Approx(cost).epsilon(1e-9));
  for (std::size_t k = 0; k < structureless.count; ++k) {
    const Vector15d difference = structureless.states[k].x.minus(with_columns.states[k].x);
    CHECK(difference.norm() < 1e-6);
    // And it is not that nothing has moved.
    CHECK(structureless.states[k].x.minus(structureless.reference[k]).norm() > (k == 0 ? 0 : 1e-4));
  }
  for (std::size_t m = 0; m < structureless.landmarks.size(); ++m) {
    CHECK((structureless.landmarks[m].point.position() - with_columns.extras[m].x.point).norm() < 1e-5);
  }
}

TEST_CASE("Columns of explicit landmarks, eliminated, are the structureless system", "[smoother][extra]") {
  Random random(59);
  Bundle bundle(random);
  auto structureless = std::make_unique<NormalEquations>();
  auto with_columns = std::make_unique<NormalEquations>();
  Bundle copy = bundle;
  bundle.place();
  // The same points in both, at the same poses.
  const int extra_dimension = kExtraDim * static_cast<int>(bundle.landmarks.size());
  const int pose_dimension = kPoseDim * static_cast<int>(bundle.count);
  structureless->begin({}, pose_dimension);
  with_columns->begin({}, extra_dimension + pose_dimension);
  for (std::size_t k = 0; k < bundle.count; ++k) {
    bundle.states[k].offset = kPoseDim * static_cast<int>(k);
    copy.states[k].offset = extra_dimension + bundle.states[k].offset;
  }
  for (std::size_t m = 0; m < bundle.landmarks.size(); ++m) {
    Landmark& landmark = bundle.landmarks[m];
    REQUIRE(triangulate(bundle.poses, landmark.views(), 20, landmark.point));
    const LandmarkViews views{landmark.views(), bundle.poses, bundle.rig.T_body_cam, {}};
    REQUIRE(structureless->addLandmark(views, landmark.point, bundle.states));
    const Eigen::Vector3d p = landmark.point.position();
    with_columns->addExplicitLandmark(views, p, kExtraDim * static_cast<int>(m), copy.states);
  }
  structureless->finish(bundle.states);
  with_columns->finish(copy.states);
  CHECK(with_columns->cost() == Approx(structureless->cost()).epsilon(1e-9));
  MatrixMap H = with_columns->H();
  for (Eigen::Index c = 0; c < H.cols(); ++c) {
    for (Eigen::Index r = c + 1; r < H.rows(); ++r) H(c, r) = H(r, c);
  }
  std::vector<double> work(static_cast<std::size_t>(H.rows()) * kStateDim);
  const std::array<ColumnRange, 2> others{ColumnRange{extra_dimension, 15}, {extra_dimension + 15, 15}};
  for (int at = 0; at < extra_dimension; at += kExtraDim) {
    eliminateColumns(H, with_columns->g(), {at, kExtraDim}, others, work);
  }
  const Eigen::MatrixXd expected =
      Eigen::MatrixXd(structureless->H()).selfadjointView<Eigen::Lower>() * Eigen::MatrixXd::Identity(30, 30);
  // The weak information on the inverse depth is in one of them only.
  CHECK((H.bottomRightCorner(30, 30) - expected).cwiseAbs().maxCoeff() < 1e-5 * expected.maxCoeff());
  CHECK((with_columns->g().tail(30) - structureless->g()).norm() <
        1e-5 * std::max(1.0, expected.maxCoeff() * 1e-4));
}
