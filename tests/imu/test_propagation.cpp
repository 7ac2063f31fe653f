// Propagation against preintegration, with re-application, gaps and consistency.

#include "estimator/imu/propagation.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/preintegration.hpp"
#include "tests/imu/analytic_trajectory.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

using Vector15d = Eigen::Matrix<double, kStateDim, 1>;

NavState truthAt(const AnalyticTrajectory& path, double t) {
  NavState state;
  state.stamp = stampOf(t);
  state.T_world_body = SE3(path.rotation(t), path.position(t));
  state.v_world_body = path.velocity(t);
  state.bias_gyro = Eigen::Vector3d(0.02, -0.03, 0.08);
  state.bias_accel = Eigen::Vector3d(-0.02, 0.13, 0.07);
  return state;
}

Matrix15d someCovariance() {
  Vector15d sigma;
  sigma << 0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.03, 0.03, 0.03, 1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02;
  Matrix15d mixing = Matrix15d::Identity();
  Random random(8);
  for (int i = 0; i < kStateDim; ++i) {
    for (int j = 0; j < i; ++j) mixing(i, j) = 0.2 * random.normal();
  }
  return sigma.asDiagonal() * mixing * mixing.transpose() * sigma.asDiagonal();
}

// x (+) error, as the error state is defined.
NavState perturb(const NavState& state, const Vector15d& error) {
  NavState out = state;
  out.T_world_body.rotation = state.T_world_body.rotation * expSo3(error.head<3>());
  out.T_world_body.translation += error.segment<3>(3);
  out.v_world_body += error.segment<3>(6);
  out.bias_gyro += error.segment<3>(9);
  out.bias_accel += error.segment<3>(12);
  return out;
}

Vector15d difference(const NavState& a, const NavState& b) {  // a (-) b
  Vector15d d;
  d << logSo3(b.T_world_body.rotation.conjugate() * a.T_world_body.rotation),
      a.T_world_body.translation - b.T_world_body.translation, a.v_world_body - b.v_world_body,
      a.bias_gyro - b.bias_gyro, a.bias_accel - b.bias_accel;
  return d;
}

NavState run(const ImuNoise& noise, const NavState& start, const std::vector<ImuSample>& samples) {
  Propagator propagator(noise);
  for (const ImuSample& sample : samples) (void)propagator.step(sample);
  REQUIRE(propagator.setState(start).ok());
  return propagator.state();
}

}  // namespace

TEST_CASE("Propagating equals preintegrating, before and after the state is set") {
  const ImuNoise noise;
  const AnalyticTrajectory path(3);
  NavState start = truthAt(path, 0.2021);  // between two samples
  Random random(1);
  const auto samples = path.samples(0, 1, noise, start.bias_gyro, start.bias_accel, &random);

  Preintegration imu(noise, start.bias_gyro, start.bias_accel);
  REQUIRE(imu.integrate(samples, start.stamp, stampOf(1)).ok());
  const double T = imu.duration();
  const Eigen::Vector3d g(0, 0, -noise.gravity);
  const SE3& pose = start.T_world_body;
  const Eigen::Vector3d v = start.v_world_body + g * T + pose.rotation * imu.deltaVelocity();
  const Eigen::Vector3d p =
      pose.translation + start.v_world_body * T + 0.5 * g * T * T + pose.rotation * imu.deltaPosition();

  const NavState late = run(noise, start, samples);
  Propagator live(noise);
  NavState last;
  for (const ImuSample& sample : samples) {
    const Status status = live.step(sample, &last);
    CHECK(status.ok() == live.hasState());
    if (!live.hasState() && sample.stamp > start.stamp - Duration::fromMilliseconds(5))
      REQUIRE(live.setState(start).ok());
  }
  for (const NavState& state : {late, last}) {
    CHECK(state.stamp == stampOf(1));
    CHECK((state.T_world_body.translation - p).norm() < 1e-11);
    CHECK((state.v_world_body - v).norm() < 1e-11);
    CHECK(logSo3(state.T_world_body.rotation.conjugate() * pose.rotation * imu.deltaRotation()).norm() <
          1e-11);
  }
  CHECK((late.covariance - last.covariance).norm() < 1e-12);

  // Started without covariance, the pose part is the preintegration's, turned into world axes; the
  // bias walks add a little.
  Eigen::Matrix<double, 9, 9> turn = Eigen::Matrix<double, 9, 9>::Identity();
  turn.block<3, 3>(3, 3) = turn.block<3, 3>(6, 6) = pose.R();
  ImuNoise no_walk = noise;
  no_walk.gyro_walk = no_walk.accel_walk = 0;
  const Matrix9d expected = turn * imu.covariance() * turn.transpose();
  const Matrix9d got = run(no_walk, start, samples).covariance.topLeftCorner<9, 9>();
  CHECK((got - expected).norm() / expected.norm() < 1e-9);
}

TEST_CASE("A prediction for before the last sample does without those after it") {
  const ImuNoise noise;
  const AnalyticTrajectory path(3);
  const NavState start = truthAt(path, 0.2021);
  const auto samples = path.samples(0, 1, noise, start.bias_gyro, start.bias_accel, nullptr);
  Propagator propagator(noise);
  for (const ImuSample& sample : samples) (void)propagator.step(sample);
  REQUIRE(propagator.setState(start).ok());
  for (const double at : {0.2021, 0.2049, 0.205, 0.7013, 0.997}) {
    INFO("at " << at << " s");
    NavState predicted;
    REQUIRE(propagator.predict(stampOf(at), predicted).ok());
    CHECK(predicted.stamp == stampOf(at));
    const NavState truth = truthAt(path, at);
    CHECK(difference(predicted, truth).head<9>().norm() < 2e-3);
  }
  NavState unused;
  CHECK(propagator.predict(stampOf(0.2), unused).code == StatusCode::kInvalidInput);
  CHECK(propagator.state().stamp == samples.back().stamp);
}

TEST_CASE("The covariance's transition agrees with numeric derivatives") {
  ImuNoise noise;
  noise.gyro_density = noise.accel_density = 1e-12;
  noise.gyro_walk = noise.accel_walk = 0;
  const AnalyticTrajectory path(5);
  NavState start = truthAt(path, 0);
  start.covariance = someCovariance();
  const auto samples = path.samples(0, 1, noise, start.bias_gyro, start.bias_accel, nullptr);
  const NavState end = run(noise, start, samples);
  Matrix15d F;
  const double h = 1e-5;
  for (int i = 0; i < kStateDim; ++i) {
    const Vector15d d = h * Vector15d::Unit(i);
    F.col(i) = (difference(run(noise, perturb(start, d), samples), end) -
                difference(run(noise, perturb(start, -d), samples), end)) /
               (2 * h);
  }
  const Matrix15d expected = F * start.covariance * F.transpose();
  const Vector15d scale = expected.diagonal().cwiseSqrt().cwiseInverse();
  CHECK((scale.asDiagonal() * (end.covariance - expected) * scale.asDiagonal()).cwiseAbs().maxCoeff() < 1e-5);
}

TEST_CASE("Propagated NEES over 1200 flights of 2 s, bias walks included", "[figures]") {
  ImuNoise noise;
  noise.accel_walk = 2e-2;  // large enough to matter in 2 s
  noise.gyro_walk = 2e-4;
  Random random(6);
  double nees = 0;
  const int runs = 1200;
  // Small, so that second order (the square of the tilt error times g t) does not show.
  const Matrix15d P0 = 0.0016 * someCovariance();
  const Matrix15d root = P0.llt().matrixL();
  for (int n = 0; n < runs; ++n) {
    const AnalyticTrajectory path(static_cast<std::uint64_t>(n), 0.5, 0.5);
    const NavState truth = truthAt(path, 0);
    auto samples = path.samples(0, 2, noise, truth.bias_gyro, truth.bias_accel, &random);
    Eigen::Vector3d walk_gyro = Eigen::Vector3d::Zero(), walk_accel = Eigen::Vector3d::Zero();
    for (ImuSample& sample : samples) {
      sample.gyro += walk_gyro;
      sample.accel += walk_accel;
      walk_gyro += noise.gyro_walk * std::sqrt(0.005) * normalVector(random);
      walk_accel += noise.accel_walk * std::sqrt(0.005) * normalVector(random);
    }
    Vector15d white;
    for (int i = 0; i < kStateDim; ++i) white[i] = random.normal();
    NavState start = perturb(truth, root * white);
    start.covariance = P0;
    const NavState end = run(noise, start, samples);
    NavState true_end = truthAt(path, 2);
    true_end.bias_gyro += walk_gyro;
    true_end.bias_accel += walk_accel;
    const Vector15d error = difference(true_end, end);
    nees += error.dot(end.covariance.ldlt().solve(error)) / runs;
  }
  const double half = 1.96 * std::sqrt(2.0 * kStateDim / runs);
  std::printf("propagation NEES, 15 dof, %d flights of 2 s: %.3f, interval %.3f to %.3f\n", runs, nees,
              kStateDim - half, kStateDim + half);
  CHECK(nees > kStateDim - half);
  CHECK(nees < kStateDim + half);
}

TEST_CASE("A gap holds attitude and velocity and grows the covariance") {
  const ImuNoise noise;
  const AnalyticTrajectory path(9);
  NavState start = truthAt(path, 0);
  start.covariance = 1e-8 * Matrix15d::Identity();
  auto samples = path.samples(0, 2, noise, start.bias_gyro, start.bias_accel, nullptr);
  samples.erase(samples.begin() + 101, samples.begin() + 301);  // 0.5 to 1.505 s
  Propagator propagator(noise);
  REQUIRE(propagator.setState(start).ok());
  NavState before, after;
  for (const ImuSample& sample : samples) {
    REQUIRE(propagator.step(sample, &after).ok());
    if (sample.stamp <= stampOf(0.5)) before = after;
    if (sample.stamp > stampOf(0.5)) break;
  }
  CHECK(propagator.gapSeconds() == Approx(1.005));
  CHECK((after.v_world_body - before.v_world_body).norm() < 1e-12);
  CHECK((after.T_world_body.translation - before.T_world_body.translation - 1.005 * before.v_world_body)
            .norm() < 1e-9);
  CHECK(std::sqrt(after.covariance(6, 6)) == Approx(3.0 * std::sqrt(1.005)).epsilon(0.01));
  CHECK(std::sqrt(after.covariance(3, 3)) ==
        Approx(3.0 * std::sqrt(1.005 * 1.005 * 1.005 / 3)).epsilon(0.01));
  const Vector15d error = difference(truthAt(path, (after.stamp - Stamp{}).seconds()), after);
  for (int i = 0; i < 9; ++i) CHECK(std::abs(error[i]) < 3.5 * std::sqrt(after.covariance(i, i)));
}

TEST_CASE("The propagator refuses bad input and reports an overrun ring") {
  const ImuNoise noise;
  const AnalyticTrajectory path(2);
  NavState start = truthAt(path, 0);
  const auto samples = path.samples(0, 6, noise, start.bias_gyro, start.bias_accel, nullptr);
  Propagator propagator(noise);
  CHECK(propagator.step(samples[0]).code == StatusCode::kNotReady);
  CHECK(propagator.step(samples[0]).code == StatusCode::kInvalidInput);  // repeated
  ImuSample bad = samples[1];
  bad.gyro.x() = std::nan("");
  CHECK(propagator.step(bad).code == StatusCode::kInvalidInput);
  for (std::size_t i = 1; i < samples.size(); ++i) (void)propagator.step(samples[i]);
  CHECK(propagator.setState(start).code == StatusCode::kCapacityReached);
  CHECK(propagator.gapSeconds() > 0.8);
  NavState broken = start;
  broken.v_world_body.x() = std::nan("");
  CHECK(propagator.setState(broken).code == StatusCode::kInvalidInput);

  REQUIRE(propagator.setState(truthAt(path, 5)).ok());
  CHECK(propagator.gapSeconds() == 0);
  NavState predicted;
  REQUIRE(propagator.predict(stampOf(6.004), predicted).ok());
  CHECK((predicted.T_world_body.translation - path.position(6.004)).norm() < 1e-3);
  CHECK(propagator.state().stamp == stampOf(6));
  CHECK(propagator.predict(stampOf(4.9), predicted).code == StatusCode::kInvalidInput);
  propagator.reset();
  CHECK_FALSE(propagator.hasState());
}

TEST_CASE("Propagation time per sample", "[figures]") {
  const ImuNoise noise;
  const AnalyticTrajectory path(1);
  const NavState start = truthAt(path, 0);
  const auto samples = path.samples(0, 10, noise, start.bias_gyro, start.bias_accel, nullptr);
  Propagator propagator(noise);
  REQUIRE(propagator.setState(start).ok());
  NavState state;
  const auto begin = std::chrono::steady_clock::now();
  for (const ImuSample& sample : samples) (void)propagator.step(sample, &state);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  std::printf("propagation: %.3f us a sample, covariance and output included\n",
              spent.count() / static_cast<double>(samples.size()) * 1e6);
  CHECK(state.stamp == samples.back().stamp);
}
