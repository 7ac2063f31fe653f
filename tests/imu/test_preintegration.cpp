// Preintegration against the dense textbook form, numeric derivatives, exact truth and Monte Carlo.

#include "estimator/imu/preintegration.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
#include "tests/imu/analytic_trajectory.hpp"

using namespace swiftlet;
using test::AnalyticTrajectory;
using test::normalVector;
using test::stampOf;

namespace {

const Eigen::Vector3d kBiasGyro(0.02, -0.03, 0.08);
const Eigen::Vector3d kBiasAccel(-0.02, 0.13, 0.07);

// The dense twin: Forster et al., A.7-A.10, midpoint rule, 9x9 products throughout.
struct DenseTwin {
  ImuNoise noise;
  Eigen::Vector3d bias_gyro, bias_accel;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), position = Eigen::Vector3d::Zero();
  Matrix9d covariance = Matrix9d::Zero();
  Eigen::Matrix<double, 9, 3> J_gyro = Eigen::Matrix<double, 9, 3>::Zero();
  Eigen::Matrix<double, 9, 3> J_accel = Eigen::Matrix<double, 9, 3>::Zero();

  void integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel) {
    const Eigen::Vector3d phi = (gyro - bias_gyro) * dt;
    const Eigen::Vector3d a = accel - bias_accel;
    const Eigen::Quaterniond half = expSo3(0.5 * phi);
    const Eigen::Matrix3d R = rotation.toRotationMatrix();
    const Eigen::Matrix3d R_half = (rotation * half).toRotationMatrix();
    const Eigen::Vector3d force = R_half * a;
    const Eigen::Matrix3d force_phi = -R * hat(half * a);
    const Eigen::Matrix3d force_gyro = R_half * hat(a) * (rightJacobianSo3(0.5 * phi) * (0.5 * dt));
    Matrix9d A = Matrix9d::Identity();
    A.block<3, 3>(0, 0) = expSo3Matrix(phi).transpose();
    A.block<3, 3>(3, 0) = 0.5 * dt * dt * force_phi;
    A.block<3, 3>(3, 6) = dt * Eigen::Matrix3d::Identity();
    A.block<3, 3>(6, 0) = dt * force_phi;
    Eigen::Matrix<double, 9, 3> B_gyro, B_accel;
    B_gyro << -rightJacobianSo3(phi) * dt, 0.5 * dt * dt * force_gyro, dt * force_gyro;
    B_accel << Eigen::Matrix3d::Zero(), -0.5 * dt * dt * R_half, -dt * R_half;
    covariance = (A * covariance * A.transpose() +
                  noise.gyro_density * noise.gyro_density / dt * B_gyro * B_gyro.transpose() +
                  noise.accel_density * noise.accel_density / dt * B_accel * B_accel.transpose())
                     .eval();
    covariance.diagonal().segment<3>(3).array() +=
        noise.accel_density * noise.accel_density * dt * dt * dt / 12;
    J_gyro = (A * J_gyro + B_gyro).eval();
    J_accel = (A * J_accel + B_accel).eval();
    position += velocity * dt + 0.5 * dt * dt * force;
    velocity += dt * force;
    rotation = (rotation * expSo3(phi)).normalized();
  }
};

// Error of preintegrated increments against the exact trajectory over [from, to].
Vector9d trueError(const AnalyticTrajectory& path, double from, double to, const Preintegration& imu,
                   double gravity) {
  const double T = to - from;
  const Eigen::Vector3d g(0, 0, -gravity);
  const Eigen::Quaterniond Rt = path.rotation(from).conjugate();
  const Eigen::Vector3d dv = Rt * (path.velocity(to) - path.velocity(from) - g * T);
  const Eigen::Vector3d dp =
      Rt * (path.position(to) - path.position(from) - path.velocity(from) * T - 0.5 * g * T * T);
  Vector9d error;
  error << logSo3(imu.deltaRotation().conjugate() * Rt * path.rotation(to)), dp - imu.deltaPosition(),
      dv - imu.deltaVelocity();
  return error;
}

double relative(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return (a - b).norm() / b.norm(); }

// Each entry of a covariance on the scale of its own sigmas.
double correlationError(const Matrix9d& a, const Matrix9d& b) {
  const Vector9d scale = b.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace

TEST_CASE("Preintegration equals its dense twin") {
  for (const double rate : {1.0, 8.0}) {
    const AnalyticTrajectory path(3, 1.0, rate);
    ImuNoise noise;
    Random random(5);
    const auto samples = path.samples(0, 1, noise, kBiasGyro, kBiasAccel, &random);
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    DenseTwin twin{noise, kBiasGyro, kBiasAccel};
    for (std::size_t i = 1; i < samples.size(); ++i) {
      const Eigen::Vector3d gyro = 0.5 * (samples[i - 1].gyro + samples[i].gyro);
      const Eigen::Vector3d accel = 0.5 * (samples[i - 1].accel + samples[i].accel);
      imu.integrate(0.005, gyro, accel);
      twin.integrate(0.005, gyro, accel);
    }
    CHECK(logSo3(imu.deltaRotation().conjugate() * twin.rotation).norm() < 1e-12);
    CHECK((imu.deltaVelocity() - twin.velocity).norm() < 1e-12);
    CHECK((imu.deltaPosition() - twin.position).norm() < 1e-12);
    CHECK(relative(imu.jacobianGyro(), twin.J_gyro) < 1e-9);
    CHECK(relative(imu.jacobianAccel(), twin.J_accel) < 1e-9);
    // The twin rotates isotropic noise by Jr, which is orthogonal only to second order in the step.
    CHECK(correlationError(imu.covariance(), twin.covariance) < 2e-3);
  }
}

TEST_CASE("The covariance of an interval between two samples is that of white noise, and not singular") {
  const ImuNoise noise;
  const AnalyticTrajectory path(3);
  const auto samples = path.samples(0, 0.1, noise, kBiasGyro, kBiasAccel, nullptr);
  for (const double to : {0.0005, 0.002, 0.0049}) {
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    REQUIRE(imu.integrate(samples, stampOf(0), stampOf(to)).ok());
    CHECK(Eigen::LLT<Matrix9d>(imu.covariance()).info() == Eigen::Success);
    const double density = noise.accel_density * noise.accel_density;
    CHECK(imu.covariance()(3, 3) == Approx(density * to * to * to / 3).epsilon(1e-3));
    CHECK(imu.covariance()(3, 6) == Approx(density * to * to / 2).epsilon(1e-3));
  }
}

TEST_CASE("Bias Jacobians agree with numeric derivatives") {
  const AnalyticTrajectory path(11);
  const ImuNoise noise;
  const auto samples = path.samples(0, 1, noise, kBiasGyro, kBiasAccel, nullptr);
  const auto run = [&](const Eigen::Vector3d& bg, const Eigen::Vector3d& ba) {
    Preintegration imu(noise, bg, ba);
    REQUIRE(imu.integrate(samples, stampOf(0.002), stampOf(0.999)).ok());
    return imu;
  };
  const Preintegration imu = run(kBiasGyro, kBiasAccel);
  const double h = 1e-5;
  Eigen::Matrix<double, 9, 3> J_gyro, J_accel;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d d = h * Eigen::Vector3d::Unit(axis);
    const auto difference = [&](const Preintegration& plus, const Preintegration& minus) {
      Vector9d out;
      out << logSo3(imu.deltaRotation().conjugate() * plus.deltaRotation()) -
                 logSo3(imu.deltaRotation().conjugate() * minus.deltaRotation()),
          plus.deltaPosition() - minus.deltaPosition(), plus.deltaVelocity() - minus.deltaVelocity();
      return Vector9d(out / (2 * h));
    };
    J_gyro.col(axis) = difference(run(kBiasGyro + d, kBiasAccel), run(kBiasGyro - d, kBiasAccel));
    J_accel.col(axis) = difference(run(kBiasGyro, kBiasAccel + d), run(kBiasGyro, kBiasAccel - d));
  }
  CHECK((imu.jacobianGyro() - J_gyro).cwiseAbs().maxCoeff() < 1e-7);
  CHECK((imu.jacobianAccel() - J_accel).cwiseAbs().maxCoeff() < 1e-7);

  // First-order correction: the error falls with the square of the bias change.
  const Eigen::Vector3d step(0.01, -0.008, 0.012);
  const auto residual = [&](double s) {
    const Preintegration moved = run(kBiasGyro + s * step, kBiasAccel);
    return (imu.deltaPosition(kBiasGyro + s * step, kBiasAccel) - moved.deltaPosition()).norm() +
           logSo3(imu.deltaRotation(kBiasGyro + s * step).conjugate() * moved.deltaRotation()).norm();
  };
  CHECK(residual(1.0) / residual(0.5) == Approx(4.0).margin(0.3));
}

TEST_CASE("Preintegration converges to exact truth with the square of the step") {
  const AnalyticTrajectory path(7, 1.0, 2.0);
  double previous = 0;
  for (const double rate : {100.0, 200.0, 400.0}) {
    ImuNoise noise;
    noise.rate_hz = rate;
    const auto samples = path.samples(0, 1, noise, kBiasGyro, kBiasAccel, nullptr);
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    REQUIRE(imu.integrate(samples, stampOf(0), stampOf(1)).ok());
    const double error = trueError(path, 0, 1, imu, noise.gravity).norm();
    if (previous > 0) CHECK(previous / error == Approx(4.0).margin(0.4));
    previous = error;
  }
  CHECK(previous < 1e-4);
}

TEST_CASE("Preintegration NEES over 1000 windows of 1 s lies in its 95 percent interval") {
  const ImuNoise noise;
  Random random(42);
  double sum = 0;
  const int windows = 1000;
  Eigen::Matrix<double, 3, 1> parts = Eigen::Vector3d::Zero();
  for (int w = 0; w < windows; ++w) {
    const AnalyticTrajectory path(static_cast<std::uint64_t>(w / 10));
    const double from = 1.0 * (w % 10);
    // One period more on either side: the window's ends then lie between samples, as images do.
    const double shift = 0.005 * random.uniform();
    const auto samples = path.samples(from - 0.005, from + 1.01, noise, kBiasGyro, kBiasAccel, &random);
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    REQUIRE(imu.integrate(samples, stampOf(from + shift), stampOf(from + shift + 1)).ok());
    const Vector9d error = trueError(path, from + shift, from + shift + 1, imu, noise.gravity);
    const Matrix9d P = imu.covariance();
    sum += error.dot(P.ldlt().solve(error));
    for (int b = 0; b < 3; ++b) {
      const Eigen::Vector3d e = error.segment<3>(3 * b);
      parts[b] += e.dot(P.block<3, 3>(3 * b, 3 * b).ldlt().solve(e)) / windows;
    }
  }
  const double nees = sum / windows;
  // The mean of 1000 chi-squared values of 9 degrees: 9 +- 1.96 sqrt(18 / 1000).
  const double half = 1.96 * std::sqrt(2.0 * 9 / windows);
  std::printf(
      "preintegration NEES, 9 dof, %d windows of 1 s: %.3f, interval %.3f to %.3f (phi %.2f p %.2f v %.2f)\n",
      windows, nees, 9 - half, 9 + half, parts[0], parts[1], parts[2]);
  CHECK(nees > 9 - half);
  CHECK(nees < 9 + half);
}

TEST_CASE("Covariance agrees with Monte Carlo") {
  const ImuNoise noise;
  const AnalyticTrajectory path(2);
  Random random(9);
  Matrix9d sample = Matrix9d::Zero();
  const int runs = 4000;
  Matrix9d P;
  for (int i = 0; i < runs; ++i) {
    const auto samples = path.samples(0, 0.3, noise, kBiasGyro, kBiasAccel, &random);
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    REQUIRE(imu.integrate(samples, stampOf(0), stampOf(0.3)).ok());
    const Vector9d error = trueError(path, 0, 0.3, imu, noise.gravity);
    sample += error * error.transpose() / runs;
    P = imu.covariance();
  }
  // An entry of a sample correlation scatters by at most sqrt(2 / runs) = 0.022; four of them.
  CHECK(correlationError(sample, P) < 0.09);
}

TEST_CASE("Holes, gaps and saturated samples raise the covariance") {
  const ImuNoise noise;
  const AnalyticTrajectory path(6);
  auto samples = path.samples(0, 1, noise, kBiasGyro, kBiasAccel, nullptr);
  const auto run = [&](const std::vector<ImuSample>& s) {
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    REQUIRE(imu.integrate(s, stampOf(0), stampOf(1)).ok());
    CHECK(imu.duration() == Approx(1.0));
    return imu;
  };
  const Preintegration whole = run(samples);
  CHECK(whole.gapDuration() == 0);

  auto hole = samples;
  hole.erase(hole.begin() + 100, hole.begin() + 104);  // 5 periods
  const Preintegration with_hole = run(hole);
  CHECK(with_hole.gapDuration() == 0);
  CHECK(with_hole.covariance().trace() > 1.05 * whole.covariance().trace());
  const Vector9d hole_error = trueError(path, 0, 1, with_hole, noise.gravity);
  CHECK(hole_error.dot(with_hole.covariance().ldlt().solve(hole_error)) < 21.7);  // 99 %

  auto gap = samples;
  gap.erase(gap.begin() + 60, gap.begin() + 140);  // 0.405 s
  const Preintegration with_gap = run(gap);
  CHECK(with_gap.gapDuration() == Approx(0.405));
  const Matrix9d P = with_gap.covariance();
  CHECK(std::sqrt(P(6, 6)) > 0.8 * 3.0 * std::sqrt(0.405));
  // Per part: after a turn of half a radian the joint distribution is no longer Gaussian.
  const Vector9d gap_error = trueError(path, 0, 1, with_gap, noise.gravity);
  for (int part = 0; part < 9; part += 3) {
    const Eigen::Vector3d e = gap_error.segment<3>(part);
    CHECK(e.dot(P.block<3, 3>(part, part).ldlt().solve(e)) < 11.3);  // 99 %, 3 degrees
  }

  auto clipped = samples;
  clipped[50].accel.x() = noise.accel_saturation;
  CHECK(run(clipped).covariance()(6, 6) > 10 * whole.covariance()(6, 6));

  // No sample after 0.9 s: held for a little, then a gap of its own.
  auto ended = samples;
  ended.resize(181);
  CHECK(run(ended).gapDuration() == Approx(0.1));
  Preintegration none(noise, kBiasGyro, kBiasAccel);
  CHECK(none.integrate({}, stampOf(0), stampOf(1)).code == StatusCode::kInvalidInput);
}

TEST_CASE("Preintegration time per sample", "[figures]") {
  const ImuNoise noise;
  const AnalyticTrajectory path(1);
  const auto samples = path.samples(0, 10, noise, kBiasGyro, kBiasAccel, nullptr);
  const auto time = [&](auto&& body) {
    double best = 1e9;
    for (int repeat = 0; repeat < 5; ++repeat) {
      const auto start = std::chrono::steady_clock::now();
      body();
      const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
      best = std::min(best, spent.count() / static_cast<double>(samples.size()) * 1e6);
    }
    return best;
  };
  double sink = 0;
  const double sparse = time([&] {
    Preintegration imu(noise, kBiasGyro, kBiasAccel);
    (void)imu.integrate(samples, samples.front().stamp, samples.back().stamp);
    sink += imu.deltaPosition().x() + imu.covariance()(0, 0);
  });
  const double dense = time([&] {
    DenseTwin twin{noise, kBiasGyro, kBiasAccel};
    for (std::size_t i = 1; i < samples.size(); ++i) twin.integrate(0.005, samples[i].gyro, samples[i].accel);
    sink += twin.position.x() + twin.covariance(0, 0);
  });
  std::printf("preintegration: %.3f us a sample, dense twin %.3f us\n", sparse, dense);
  CHECK(std::isfinite(sink));
  CHECK(sparse < dense);
}
