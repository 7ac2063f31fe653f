// Factors between two states: Jacobians against numeric differentiation, what they leave free, and
// their meaning on exact motion.

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/gyro_intrinsics_state.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::numericJacobian;
using test::randomVector;
using test::relativeDifference;

namespace {

using Matrix15 = Eigen::Matrix<double, kStateDim, kStateDim>;
constexpr double kMotionTolerance = 1e-6;  // relative: the residuals are scaled by up to 1e5

BodyState randomState(Random& random) {
  BodyState x;
  x.T_world_body = SE3(expSo3(randomVector(random, 1.5)), randomVector(random, 5));
  x.v_world_body = randomVector(random, 2);
  x.bias_gyro = randomVector(random, 0.05);
  x.bias_accel = randomVector(random, 0.2);
  return x;
}

BodyState retracted(const BodyState& x, const Vector15d& delta) {
  BodyState moved = x;
  moved.retract(delta);
  return moved;
}

// 0.3 s of lively motion, integrated at the given biases.
Preintegration livelyIncrement(const ImuNoise& noise, const Eigen::Vector3d& bias_gyro,
                               const Eigen::Vector3d& bias_accel, Random& random) {
  Preintegration imu(noise, bias_gyro, bias_accel);
  for (int k = 0; k < 60; ++k) {
    imu.integrate(0.005, Eigen::Vector3d(0.4, -0.8, 1.5) + randomVector(random, 0.5),
                  Eigen::Vector3d(9.0, 2.0, -3.0) + randomVector(random, 1.0));
  }
  return imu;
}

// The state that the increment leads to, off by a little so that the residual is not zero.
BodyState reached(const BodyState& x, const Preintegration& imu, const ImuNoise& noise, Random& random,
                  double error) {
  const double dt = imu.duration();
  const Eigen::Vector3d g(0, 0, -noise.gravity);
  const Eigen::Quaterniond& R = x.T_world_body.rotation;
  BodyState y = x;
  y.T_world_body.rotation = R * imu.deltaRotation(x.bias_gyro);
  y.T_world_body.translation +=
      dt * x.v_world_body + 0.5 * dt * dt * g + R * imu.deltaPosition(x.bias_gyro, x.bias_accel);
  y.v_world_body += dt * g + R * imu.deltaVelocity(x.bias_gyro, x.bias_accel);
  Vector15d off;
  for (int k = 0; k < kStateDim; ++k) off[k] = error * random.normal();
  y.retract(off);
  return y;
}

// Motion of both states in the direction that no inertial or visual measurement sees: a turn about
// gravity, `axis` = 3, or a shift along world axis 0, 1 or 2.
Vector15d unobservable(const BodyState& x, int axis) {
  Vector15d n = Vector15d::Zero();
  if (axis < 3) {
    n[3 + axis] = 1;
    return n;
  }
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  n.segment<3>(0) = x.T_world_body.rotation.conjugate() * z;
  n.segment<3>(3) = z.cross(x.T_world_body.translation);
  n.segment<3>(6) = z.cross(x.v_world_body);
  return n;
}

template <typename Evaluate>
void checkMotionJacobians(const Evaluate& evaluate, const BodyState& x_i, const BodyState& x_j) {
  MotionFactor factor;
  REQUIRE(evaluate(x_i, x_j, factor));
  const auto plus = [](const BodyState& x, const Vector15d& d) { return retracted(x, d); };
  const auto minus = [](const Vector15d& a, const Vector15d& b) { return Vector15d(a - b); };
  const auto of_i = [&](const BodyState& x) {
    MotionFactor f;
    REQUIRE(evaluate(x, x_j, f));
    return f.residual;
  };
  const auto of_j = [&](const BodyState& x) {
    MotionFactor f;
    REQUIRE(evaluate(x_i, x, f));
    return f.residual;
  };
  const Matrix15 J_i = numericJacobian<kStateDim, kStateDim>(of_i, x_i, plus, minus);
  const Matrix15 J_j = numericJacobian<kStateDim, kStateDim>(of_j, x_j, plus, minus);
  // Row by row: a whitened rotation row is 1e3 times a bias row.
  for (int row = 0; row < kStateDim; ++row) {
    INFO("row " << row);
    CHECK(relativeDifference(factor.jacobian_i.row(row), J_i.row(row)) < kMotionTolerance);
    CHECK(relativeDifference(factor.jacobian_j.row(row), J_j.row(row)) < kMotionTolerance);
  }
}

}  // namespace

TEST_CASE("State: retract and minus are inverse to each other", "[smoother][state]") {
  Random random(4);
  for (int k = 0; k < 50; ++k) {
    const BodyState x = randomState(random);
    Vector15d delta;
    for (int i = 0; i < kStateDim; ++i) delta[i] = random.uniform(-1, 1);
    CHECK((retracted(x, delta).minus(x) - delta).norm() < 1e-12);
    CHECK(retracted(x, Vector15d::Zero()).minus(x).norm() < 1e-12);
  }
}

TEST_CASE("IMU factor: Jacobians in every block, biases off the increment's", "[smoother][imu_factor]") {
  const ImuNoise noise;
  Random random(5);
  for (int trial = 0; trial < 30; ++trial) {
    INFO("trial " << trial);
    const BodyState x_i = randomState(random);
    const Preintegration imu = livelyIncrement(noise, x_i.bias_gyro + randomVector(random, 0.01),
                                               x_i.bias_accel + randomVector(random, 0.1), random);
    // Half of the trials near the solution, half with a large residual (0.3 rad, 0.3 m).
    const BodyState x_j = reached(x_i, imu, noise, random, trial % 2 == 0 ? 1e-3 : 0.3);
    checkMotionJacobians([&](const BodyState& a, const BodyState& b,
                             MotionFactor& f) { return imuFactor(imu, noise, a, b, f); },
                         x_i, x_j);
  }
}

TEST_CASE("IMU factor: Jacobian by the gyro's matrix", "[smoother][imu_factor]") {
  const ImuNoise noise;
  Random random(11);
  using Matrix = GyroIntrinsicsState::Vector;
  const auto plus = [](const GyroIntrinsicsState& matrix, const Matrix& step) {
    GyroIntrinsicsState moved = matrix;
    moved.retract(step);
    return moved;
  };
  const auto minus = [](const Vector9d& a, const Vector9d& b) { return Vector9d(a - b); };
  for (int trial = 0; trial < 10; ++trial) {
    INFO("trial " << trial);
    const BodyState x_i = randomState(random);
    const Preintegration imu = livelyIncrement(noise, x_i.bias_gyro, x_i.bias_accel, random);
    const BodyState x_j = reached(x_i, imu, noise, random, 0.01);
    const auto residual = [&](const GyroIntrinsicsState& matrix) {
      MotionFactor f;
      REQUIRE(imuFactor(imu, noise, x_i, x_j, f, &matrix));
      return Vector9d(f.residual.head<9>());
    };
    Matrix step;
    for (int k = 0; k < kGyroMatrixDim; ++k) step[k] = 5e-3 * random.normal();
    const GyroIntrinsicsState at = plus(GyroIntrinsicsState(true, 0), step);
    MotionFactor factor;
    REQUIRE(imuFactor(imu, noise, x_i, x_j, factor, &at));
    REQUIRE(factor.with_gyro);
    const auto J = numericJacobian<9, kGyroMatrixDim>(residual, at, plus, minus);
    CHECK(relativeDifference(factor.jacobian_gyro_matrix, J) < kMotionTolerance);
  }
}

TEST_CASE("IMU factor: a gyro's matrix acts on an increment as it does on its samples",
          "[smoother][imu_factor]") {
  Random random(12);
  const Eigen::Vector3d bias = randomVector(random, 0.02);
  GyroIntrinsics wrong;
  for (double& entry : wrong.matrix.reshaped()) entry = 5e-3 * random.normal();
  Preintegration given(ImuNoise{}, bias, Eigen::Vector3d::Zero());
  Preintegration corrected(ImuNoise{}, bias, Eigen::Vector3d::Zero(), wrong);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d gyro = Eigen::Vector3d(0.4, -0.8, 1.5) + randomVector(random, 0.5);
    const Eigen::Vector3d accel = Eigen::Vector3d(9.0, 2.0, -3.0) + randomVector(random, 1.0);
    given.integrate(0.005, gyro, accel);
    corrected.integrate(0.005, gyro, accel);
  }
  const Eigen::Vector3d at = given.biasFor(wrong, bias);
  const auto turn = [](const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
    return a.angularDistance(b);
  };
  const double effect = turn(given.deltaRotation(), corrected.deltaRotation());
  CHECK(effect > 3e-3);
  CHECK(turn(given.deltaRotation(at), corrected.deltaRotation()) < 0.05 * effect);
  CHECK((given.deltaVelocity(at, Eigen::Vector3d::Zero()) - corrected.deltaVelocity()).norm() <
        0.05 * (given.deltaVelocity() - corrected.deltaVelocity()).norm());
  CHECK(turn(corrected.deltaRotation(corrected.biasFor(wrong, bias)), corrected.deltaRotation()) < 1e-12);
}

TEST_CASE("IMU factor: zero on the motion it was integrated from, whitened by its covariance",
          "[smoother][imu_factor]") {
  const ImuNoise noise;
  Random random(7);
  const BodyState x_i = randomState(random);
  const Preintegration imu = livelyIncrement(noise, x_i.bias_gyro, x_i.bias_accel, random);
  const BodyState exact = reached(x_i, imu, noise, random, 0);
  MotionFactor factor;
  REQUIRE(imuFactor(imu, noise, x_i, exact, factor));
  CHECK(factor.residual.norm() < 1e-7);

  // An error drawn from the covariance has a squared norm of 9 in the mean.
  const Matrix9d L = imu.covariance().llt().matrixL();
  const Eigen::Quaterniond& R = x_i.T_world_body.rotation;
  double sum = 0;
  constexpr int kDraws = 2000;
  for (int k = 0; k < kDraws; ++k) {
    Vector9d n;
    for (int i = 0; i < 9; ++i) n[i] = random.normal();
    const Vector9d e = L * n;
    BodyState y = exact;
    y.T_world_body.rotation = y.T_world_body.rotation * expSo3(e.head<3>());
    y.T_world_body.translation += R * e.segment<3>(3);
    y.v_world_body += R * e.tail<3>();
    REQUIRE(imuFactor(imu, noise, x_i, y, factor));
    sum += factor.residual.squaredNorm();
  }
  // Mean of chi-square(9) over 2000 draws: sigma sqrt(18 / 2000) = 0.095; four sigmas.
  CHECK(sum / kDraws == Approx(9.0).margin(0.4));

  // Biases walk with their density: one sigma in each axis.
  BodyState walked = exact;
  const double root = std::sqrt(imu.duration());
  walked.bias_gyro += Eigen::Vector3d::Constant(noise.gyro_walk * root);
  walked.bias_accel += Eigen::Vector3d::Constant(noise.accel_walk * root);
  REQUIRE(imuFactor(imu, noise, x_i, walked, factor));
  CHECK((factor.residual.tail<6>() - Eigen::Matrix<double, 6, 1>::Ones()).norm() < 1e-9);
}

TEST_CASE("Constant velocity factor: Jacobians and a zero", "[smoother][imu_factor]") {
  const ImuNoise noise;
  Random random(8);
  for (const double duration : {0.05, 0.4, 1.0, 3.0}) {
    for (int trial = 0; trial < 10; ++trial) {
      INFO("duration " << duration << ", trial " << trial);
      const BodyState x_i = randomState(random);
      const BodyState x_j = reached(x_i, Preintegration(), noise, random, 0.3);
      checkMotionJacobians([&](const BodyState& a, const BodyState& b,
                               MotionFactor& f) { return constantVelocityFactor(duration, noise, a, b, f); },
                           x_i, x_j);
    }
    const BodyState x = randomState(random);
    BodyState coasted = x;
    coasted.T_world_body.translation += duration * x.v_world_body;
    MotionFactor factor;
    REQUIRE(constantVelocityFactor(duration, noise, x, coasted, factor));
    CHECK(factor.residual.norm() < 1e-9);
  }
}

TEST_CASE("Motion factors do not see position and yaw", "[smoother][imu_factor]") {
  const ImuNoise noise;
  Random random(9);
  for (int trial = 0; trial < 20; ++trial) {
    const BodyState x_i = randomState(random);
    const Preintegration imu = livelyIncrement(noise, x_i.bias_gyro, x_i.bias_accel, random);
    const BodyState x_j = reached(x_i, imu, noise, random, 0.02);
    MotionFactor inertial;
    MotionFactor loose;
    REQUIRE(imuFactor(imu, noise, x_i, x_j, inertial));
    REQUIRE(constantVelocityFactor(0.3, noise, x_i, x_j, loose));
    for (int axis = 0; axis < 4; ++axis) {
      INFO("trial " << trial << ", direction " << axis);
      const Vector15d n_i = unobservable(x_i, axis);
      const Vector15d n_j = unobservable(x_j, axis);
      const double scale = inertial.jacobian_i.norm() * n_i.norm();
      CHECK((inertial.jacobian_i * n_i + inertial.jacobian_j * n_j).norm() < 1e-12 * scale);
      // The loose factor's position and velocity rows are in world axes: a turn of both states turns the
      // residual, which is as much as it can see of yaw (its sigmas are metres).
      const Eigen::Vector3d z = axis == 3 ? Eigen::Vector3d(0, 0, 1) : Eigen::Vector3d(0, 0, 0);
      const Vector15d seen = loose.jacobian_i * n_i + loose.jacobian_j * n_j;
      CHECK(seen.head<3>().norm() < 1e-10);
      CHECK((seen.segment<3>(3) - z.cross(loose.residual.segment<3>(3))).norm() < 1e-9);
      CHECK((seen.segment<3>(6) - z.cross(loose.residual.segment<3>(6))).norm() < 1e-9);
    }
    // Not blind to everything: a turn about a horizontal axis moves gravity.
    Vector15d tilt_i = Vector15d::Zero();
    Vector15d tilt_j = Vector15d::Zero();
    const Eigen::Vector3d x_axis = Eigen::Vector3d::UnitX();
    tilt_i.head<3>() = x_i.T_world_body.rotation.conjugate() * x_axis;
    tilt_j.head<3>() = x_j.T_world_body.rotation.conjugate() * x_axis;
    tilt_i.segment<3>(3) = x_axis.cross(x_i.T_world_body.translation);
    tilt_j.segment<3>(3) = x_axis.cross(x_j.T_world_body.translation);
    tilt_i.segment<3>(6) = x_axis.cross(x_i.v_world_body);
    tilt_j.segment<3>(6) = x_axis.cross(x_j.v_world_body);
    CHECK((inertial.jacobian_i * tilt_i + inertial.jacobian_j * tilt_j).norm() > 10.0);
  }
}

TEST_CASE("Motion factors refuse an interval without duration", "[smoother][imu_factor]") {
  const ImuNoise noise;
  const BodyState x;
  MotionFactor factor;
  CHECK_FALSE(imuFactor(Preintegration(noise, x.bias_gyro, x.bias_accel), noise, x, x, factor));
  CHECK_FALSE(constantVelocityFactor(0, noise, x, x, factor));
  CHECK_FALSE(constantVelocityFactor(std::nan(""), noise, x, x, factor));
}
