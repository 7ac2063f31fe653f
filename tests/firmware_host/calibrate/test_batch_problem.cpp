#include <Eigen/Dense>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/imu_camera/batch_start.hpp"
#include "tests/firmware_host/calibrate/simulated_calibration.hpp"

namespace swiftlet {
namespace {

CalibrationSession sessionOf(std::uint64_t seed, double duration, SessionSettings settings = {}) {
  settings.seed = seed;
  settings.duration = duration;
  const CameraKind lens = seed % 2 == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant;
  return {drawCalibrationRig(seed, lens), CalibrationTarget{}, settings};
}

BatchStart startOf(const ImuCameraInput& input) {
  return startBatch(input.target, input.views, input.samples, input.noise, input.cameras, 0.1);
}

Eigen::VectorXd randomStep(Random& random, int size, double scale) {
  Eigen::VectorXd step(size);
  for (int k = 0; k < size; ++k) step[k] = scale * random.normal();
  return step;
}

TEST_CASE("a step gains nothing by a corner that the lens can no longer project") {
  const BatchStart start = startOf(batchInput(sessionOf(204, 12)));
  REQUIRE(start.reasons.empty());
  const bool robust = GENERATE(false, true);
  const auto costOf = [&](const BatchData& data) {
    const BatchProblem problem(data, start.state, {});
    ArrowSystem system = problem.emptySystem();
    return problem.assemble(system, robust);
  };
  BatchData lost = start.data;
  lost.views[lost.views.size() / 2].corners.front().point = {0, 0, 100};  // behind the camera
  CHECK(costOf(lost) > costOf(start.data));
}

TEST_CASE("an arrow system is solved as its dense matrix is") {
  Random random(20, 1);
  constexpr int kChain = 30;
  constexpr int kWidth = 7;
  constexpr int kBorder = 5;
  ArrowSystem system(kChain, kWidth, kBorder);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kChain + kBorder, kChain + kBorder);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(kChain + kBorder);
  for (int k = 0; k < kChain; ++k) {
    const std::array<int, 1> column{k};
    system.add(column, Eigen::Matrix<double, 1, 1>(0.5), Eigen::Matrix<double, 1, 1>(0));
    dense(k, k) += 0.5;
  }
  for (int first = 0; first + kWidth < kChain; ++first) {
    std::vector<int> columns;
    for (int k = 0; k <= kWidth; k += 2) columns.push_back(first + (k + 3) % (kWidth + 1));
    for (int k = 0; k < kBorder; ++k) columns.push_back(kChain + k);
    const auto count = static_cast<Eigen::Index>(columns.size());
    Eigen::MatrixXd J(12, count);
    for (Eigen::Index i = 0; i < J.size(); ++i) J(i) = random.normal();
    const Eigen::MatrixXd H = J.transpose() * J;
    const Eigen::VectorXd g = randomStep(random, static_cast<int>(count), 1);
    system.add(columns, H, g);
    for (Eigen::Index i = 0; i < count; ++i) {
      gradient[columns[static_cast<std::size_t>(i)]] += g[i];
      for (Eigen::Index j = 0; j < count; ++j) {
        dense(columns[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]) += H(i, j);
      }
    }
  }
  CHECK((system.gradient() - gradient).norm() < 1e-12);
  const ArrowFactor factor(system, 0);
  REQUIRE(factor.ok());
  const Eigen::VectorXd right = randomStep(random, kChain + kBorder, 1);
  const Eigen::VectorXd expected = dense.ldlt().solve(right);
  CHECK((factor.solve(right) - expected).norm() < 1e-9 * expected.norm());

  // Border and two averages of the chain.
  Eigen::MatrixXd averages(kChain, 2);
  for (Eigen::Index i = 0; i < averages.size(); ++i) averages(i) = random.normal();
  Eigen::MatrixXd wanted = Eigen::MatrixXd::Zero(kChain + kBorder, kBorder + 2);
  wanted.block(kChain, 0, kBorder, kBorder).setIdentity();
  wanted.block(0, kBorder, kChain, 2) = averages;
  const Eigen::MatrixXd covariance = wanted.transpose() * dense.ldlt().solve(wanted);
  CHECK((factor.covariance(averages) - covariance).norm() < 1e-9 * covariance.norm());

  system.hold(2);
  CHECK(ArrowFactor(system, 0).solve(-system.gradient())[kChain + 2] == 0);
}

TEST_CASE("derivatives of the spline by its controls are those of finite differences") {
  Random random(21, 1);
  std::vector<SE3> controls;
  SE3 pose;
  for (int k = 0; k < 9; ++k) {
    pose = SE3(pose.rotation * expSo3(0.3 * randomStep(random, 3, 1)), 0.2 * randomStep(random, 3, 1));
    controls.push_back(pose);
  }
  const SplineTrajectory spline(1.0, 0.1, controls);
  const double time = 1.237;
  SplineJacobian jacobian;
  const MotionState state = spline.at(time, jacobian);
  constexpr double kStep = 1e-6;
  for (std::size_t l = 0; l < SplineTrajectory::kOrder; ++l) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(axis);
      const auto movedBy = [&](double sign, bool turn) {
        SplineTrajectory other = spline;
        SE3& control = other.controls()[jacobian.first + l];
        if (turn) control.rotation = control.rotation * expSo3(sign * d);
        if (!turn) control.translation += sign * d;
        return other.at(time);
      };
      const MotionState up = movedBy(1, true);
      const MotionState down = movedBy(-1, true);
      const Eigen::Vector3d turn =
          logSo3(down.T_world_body.rotation.conjugate() * up.T_world_body.rotation) / (2 * kStep);
      CHECK((jacobian.rotation[l].col(axis) - turn).norm() < 1e-7);
      CHECK((jacobian.rate[l].col(axis) - (up.omega_body - down.omega_body) / (2 * kStep)).norm() < 1e-6);
      const MotionState right = movedBy(1, false);
      const MotionState left = movedBy(-1, false);
      const Eigen::Vector3d moved =
          (right.T_world_body.translation - left.T_world_body.translation) / (2 * kStep);
      CHECK((jacobian.position[l] * Eigen::Vector3d::Unit(axis) - moved).norm() < 1e-7);
      const Eigen::Vector3d force = (right.a_world_body - left.a_world_body) / (2 * kStep);
      CHECK((jacobian.acceleration[l] * Eigen::Vector3d::Unit(axis) - force).norm() <
            1e-6 * (1 + force.norm()));
    }
  }
  CHECK((state.omega_body - spline.at(time).omega_body).norm() == 0);
}

// The gradient of the whole cost, a lens of each kind: what Gauss-Newton walks by.
TEST_CASE("the batch's gradient is that of finite differences") {
  for (const std::uint64_t seed : {2U, 3U}) {
    SessionSettings slow;
    slow.camera_rate = 10;
    const ImuCameraInput input = batchInput(sessionOf(seed, 12, slow));
    BatchStart start = startOf(input);
    REQUIRE(start.reasons.empty());
    // Some views and readings are enough for a derivative.
    constexpr std::size_t kEvery = 10;
    std::vector<SeenView> some;
    for (std::size_t k = 0; k < start.data.views.size(); k += kEvery) some.push_back(start.data.views[k]);
    start.data.views = some;
    start.data.readings.resize(start.data.readings.size() / 4);
    BatchState state = start.state;
    state.readout = 0.01;
    BatchProblem problem(start.data, state, {0.2, 1, 1});
    problem.hold(batch::kScale, 2, false);
    ArrowSystem system = problem.emptySystem();
    const double cost = problem.assemble(system, false);
    const Eigen::VectorXd gradient = system.gradient();
    Random random(seed, 31);
    const auto costAlong = [&](const Eigen::VectorXd& step) {
      BatchProblem other(start.data, problem.moved(step), {0.2, 1, 1});
      ArrowSystem unused = other.emptySystem();
      return other.assemble(unused, false);
    };
    // Each column of the calibration, and all of the chain in random directions.
    const int chain = problem.chainSize();
    for (int k = 0; k < batch::kColumns + 10; ++k) {
      Eigen::VectorXd direction = Eigen::VectorXd::Zero(gradient.size());
      if (k < batch::kColumns) direction[chain + k] = 1;
      if (k >= batch::kColumns) direction.head(chain) = randomStep(random, chain, 1);
      const bool pixels = k < 28 && k % 14 < 4;
      const double size = pixels ? 1e-3 : 1e-7;
      const double slope = (costAlong(size * direction) - costAlong(-size * direction)) / (4 * size);
      CAPTURE(seed, k, slope, gradient.dot(direction));
      // Start values leave large residuals, so the costs are large beside their difference: each is rounded.
      const double rounding = 4 * std::numeric_limits<double>::epsilon() * cost / (2 * size);
      CHECK(std::abs(slope - gradient.dot(direction)) <
            1e-4 * (std::abs(slope) + std::abs(gradient.dot(direction))) + rounding);
    }
  }
}

TEST_CASE("two rigs are calibrated within what they say of themselves") {
  for (const std::uint64_t seed : {101U, 102U}) {
    SessionSettings slow;
    slow.camera_rate = 10;
    const CalibrationSession session = sessionOf(seed, 20, slow);
    const ImuCameraSolution solution = calibrateImuCamera(batchInput(session));
    REQUIRE(!solution.values.empty());
    const CalibrationErrors errors = errorsOf(solution, session);
    for (const ValueError& value : errors.values) {
      CAPTURE(seed, value.name, value.error, value.sigma);
      CHECK(std::abs(value.error) < 5 * value.sigma);
    }
    // chi^2 of some 50 values: 0.35 to 2 times its dimension by far not once in 10,000.
    const auto dimension = static_cast<double>(errors.values.size());
    CHECK(errors.nees > 0.35 * dimension);
    CHECK(errors.nees < 2 * dimension);
    CHECK(solution.gyro_sigma == Approx(1).margin(0.05));
    CHECK(solution.accel_sigma == Approx(1).margin(0.05));
    CHECK(solution.corner_sigma == Approx(0.1).margin(0.005));
  }
}

}  // namespace
}  // namespace swiftlet
