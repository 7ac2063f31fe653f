// Starts on simulated data with exact truth: at rest, in motion with stereo, with one camera.

#include "estimator/imu/initialization.hpp"

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/mono_start.hpp"
#include "estimator/imu/stereo_start.hpp"
#include "tests/imu/analytic_trajectory.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

const Eigen::Vector3d kBiasGyro(0.01, -0.02, 0.05);
const Eigen::Vector3d kBiasAccel(0.05, -0.08, 0.03);

struct Window {
  std::vector<ImuSample> samples;
  std::vector<Preintegration> from_first;
  TiltEstimate tilt;
  Eigen::Vector3d up, velocity;
};

// `frames` images after the first, `interval` apart, from t = 1 s; half a second of IMU before.
Window makeWindow(const AnalyticTrajectory& path, int frames, double interval, const ImuNoise& noise,
                  const StartPrior& prior, Random& random) {
  Window w;
  w.samples = path.samples(0.5, 1.005 + frames * interval, noise, kBiasGyro, kBiasAccel, &random);
  REQUIRE(estimateTilt(w.samples, stampOf(1), noise, prior, w.tilt).ok());
  for (int k = 1; k <= frames; ++k) {
    w.from_first.emplace_back(noise, prior.bias_gyro, prior.bias_accel);
    REQUIRE(w.from_first.back().integrate(w.samples, stampOf(1), stampOf(1 + k * interval)).ok());
  }
  const Eigen::Quaterniond inverse = path.rotation(1).conjugate();
  w.up = inverse * Eigen::Vector3d::UnitZ();
  w.velocity = inverse * path.velocity(1);
  return w;
}

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

std::vector<BearingTrack> makeTracks(const AnalyticTrajectory& path, const SE3& T_body_cam, int frames,
                                     double interval, double sigma, Random& random) {
  std::vector<BearingTrack> tracks(100);
  const SE3 first = SE3(path.rotation(1), path.position(1)) * T_body_cam;
  for (BearingTrack& track : tracks) {
    const double depth = random.uniform(2, 8);
    const Eigen::Vector3d world =
        first * Eigen::Vector3d(depth * random.uniform(-0.8, 0.8), depth * random.uniform(-0.5, 0.5), depth);
    for (int k = 0; k <= frames; ++k) {
      const double t = 1 + k * interval;
      const SE3 camera = SE3(path.rotation(t), path.position(t)) * T_body_cam;
      const Eigen::Vector3d y = camera.inverse() * world;
      if (y.z() < 0.3) break;
      const Eigen::Vector3d f = y.normalized();
      track.bearing[static_cast<std::size_t>(k)] = (f + sigma * normalVector(random)).normalized();
      track.seen |= 1U << static_cast<unsigned>(k);
    }
  }
  return tracks;
}

}  // namespace

TEST_CASE("The gravity-aligned rotation takes up to z and turns least") {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d up = normalVector(random).normalized();
    const Eigen::Quaterniond q = gravityAlignedRotation(up);
    CHECK((q * up - Eigen::Vector3d::UnitZ()).norm() < 1e-9);
    CHECK(logSo3(q).norm() == Approx(angle(up, Eigen::Vector3d::UnitZ())).margin(1e-7));
  }
  CHECK((gravityAlignedRotation(-Eigen::Vector3d::UnitZ()) * -Eigen::Vector3d::UnitZ()).z() == Approx(1.0));
}

TEST_CASE("Start at rest: errors agree with the covariance") {
  const ImuNoise noise;
  StartPrior prior;
  Random random(12);
  double tilt_nees = 0, bias_nees = 0;
  const int runs = 300;
  for (int n = 0; n < runs; ++n) {
    const Eigen::Vector3d true_up = normalVector(random).normalized();
    const Eigen::Vector3d bias = prior.bias_accel_sigma * normalVector(random);
    RestState rest;
    rest.at_rest = true;
    rest.duration = 2;
    rest.mean_gyro = kBiasGyro + noise.gyro_density / std::sqrt(2.0) * normalVector(random);
    rest.mean_accel =
        noise.gravity * true_up + bias + noise.accel_density / std::sqrt(2.0) * normalVector(random);
    NavState state;
    REQUIRE(initializeAtRest(rest, stampOf(1), noise, prior, state).ok());
    const Eigen::Quaterniond q = state.T_world_body.rotation;
    // The true attitude nearest to the estimate: up_true = Exp(-phi) up.
    const Eigen::Vector3d up = q.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d phi = true_up.cross(up);
    Eigen::Matrix<double, 6, 1> error;
    error << phi, bias - state.bias_accel;
    Eigen::Matrix<double, 6, 6> P;
    P << state.covariance.block<3, 3>(0, 0), state.covariance.block<3, 3>(0, 12),
        state.covariance.block<3, 3>(12, 0), state.covariance.block<3, 3>(12, 12);
    CHECK(Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(P).eigenvalues()[0] > -1e-12);
    tilt_nees += phi.squaredNorm() / P.topLeftCorner<3, 3>().trace() / runs;
    bias_nees += error.tail<3>().squaredNorm() / P.bottomRightCorner<3, 3>().trace() / runs;
    // Tilt and bias are told apart by nothing: their correlation predicts one from the other.
    const Eigen::Vector3d predicted = up.cross(error.tail<3>()) / noise.gravity;
    CHECK((predicted - phi).norm() < 2e-3);
  }
  CHECK(tilt_nees == Approx(1.0).margin(0.2));
  CHECK(bias_nees == Approx(1.0).margin(0.2));
  NavState state;
  CHECK(initializeAtRest(RestState{}, stampOf(1), noise, prior, state).code == StatusCode::kNotReady);
}

TEST_CASE("Tilt: refused without samples and in free fall") {
  const ImuNoise noise;
  TiltEstimate tilt;
  CHECK(estimateTilt({}, stampOf(1), noise, {}, tilt).code == StatusCode::kInvalidInput);
  const std::vector<ImuSample> falling{{stampOf(0.9), Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 0, 0.5)}};
  CHECK(estimateTilt(falling, stampOf(1), noise, {}, tilt).code == StatusCode::kDegenerate);
}

TEST_CASE("Stereo start on simulated flights is right and consistent", "[figures]") {
  const ImuNoise noise;
  const StartPrior prior;
  Random random(21);
  double velocity_nees = 0, bias_nees = 0, rms = 0, velocity_error = 0, worst_tilt = 0, microseconds = 0;
  const int runs = 200;
  for (int n = 0; n < runs; ++n) {
    const AnalyticTrajectory path(static_cast<std::uint64_t>(n), 0.5, 1.0);
    const Window w = makeWindow(path, 10, 0.05, noise, prior, random);
    const Eigen::Vector3d offset = 0.002 * normalVector(random);
    std::vector<StartFrame> frames;
    for (int k = 1; k <= 10; ++k) {
      const double t = 1 + 0.05 * k;
      StartFrame frame;
      frame.from_first = &w.from_first[static_cast<std::size_t>(k - 1)];
      frame.position = path.rotation(1).conjugate() * (path.position(t) - path.position(1)) +
                       0.002 * normalVector(random) - offset;
      frame.rotation = path.rotation(1).conjugate() * path.rotation(t) * expSo3(0.001 * normalVector(random));
      frame.position_sigma = 0.002;
      frame.rotation_sigma = 0.001;
      frames.push_back(frame);
    }
    MotionStart start;
    const auto begin = std::chrono::steady_clock::now();
    REQUIRE(solveStereoStart(frames, w.tilt, noise, prior, start).ok());
    microseconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() * 1e6 / runs;
    const Eigen::Vector3d v = w.velocity - start.velocity;
    const Eigen::Vector3d b = kBiasGyro - start.bias_gyro;
    velocity_nees += v.dot(start.covariance.block<3, 3>(3, 3).inverse() * v) / runs;
    bias_nees += b.dot(start.covariance.block<3, 3>(6, 6).inverse() * b) / runs;
    rms += start.residual_rms / runs;
    velocity_error += v.norm() / runs;
    worst_tilt = std::max(worst_tilt, angle(w.up, start.up));

    const NavState state = toNavState(start, stampOf(1), prior);
    CHECK((state.T_world_body.rotation * start.up - Eigen::Vector3d::UnitZ()).norm() < 1e-9);
    CHECK((state.T_world_body.rotation.conjugate() * state.v_world_body - start.velocity).norm() < 1e-9);
  }
  std::printf(
      "stereo start, simulated, 0.5 s, 2 mm: NEES velocity %.2f, gyro bias %.2f (3 dof), residual %.2f, "
      "velocity %.3f m/s, worst tilt %.2f deg, %.0f us\n",
      velocity_nees, bias_nees, rms, velocity_error, worst_tilt * 57.3, microseconds);
  CHECK(velocity_nees < 4.0);
  CHECK(velocity_nees > 1.5);
  CHECK(bias_nees < 4.0);
  CHECK(bias_nees > 1.5);
  CHECK(rms == Approx(1.0).margin(0.15));
  CHECK(velocity_error < 0.04);
  MotionStart start;
  CHECK(solveStereoStart({}, {}, noise, prior, start).code == StatusCode::kNotReady);
}

TEST_CASE("Mono start on simulated flights: scale sigma is honest", "[figures]") {
  const ImuNoise noise;
  const StartPrior prior;
  const SE3 T_body_cam(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(0.05, 0.02, -0.01));
  const double sigma = 1.3e-3;
  Random random(31);
  int solved = 0, inside = 0, believed = 0, believed_bad = 0, bias_inside = 0;
  double milliseconds = 0, bias_error = 0, worst_bias = 0;
  const int runs = 300;
  for (int n = 0; n < runs; ++n) {
    const AnalyticTrajectory path(static_cast<std::uint64_t>(n), 0.5, 0.6);
    const Window w = makeWindow(path, 10, 0.1, noise, prior, random);
    const std::vector<BearingTrack> tracks = makeTracks(path, T_body_cam, 10, 0.1, sigma, random);
    Eigen::Vector3d bias;
    double bias_sigma = 0;
    REQUIRE(solveGyroBias(w.from_first, tracks, T_body_cam, sigma, prior, bias, bias_sigma).ok());
    bias_error += (bias - kBiasGyro).norm() / runs;
    bias_inside += (bias - kBiasGyro).norm() < 5 * bias_sigma ? 1 : 0;
    worst_bias = std::max(worst_bias, (bias - kBiasGyro).norm());
    MonoStart start;
    const auto begin = std::chrono::steady_clock::now();
    const Status status =
        solveMonoStart(w.from_first, tracks, T_body_cam, sigma, w.tilt, noise, prior, start);
    milliseconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() * 1e3 / runs;
    if (!status.ok()) continue;
    ++solved;
    const Eigen::Vector3d truth = path.rotation(1).conjugate() * (path.position(2) - path.position(1));
    const Preintegration& last = w.from_first.back();
    const Eigen::Vector3d moved = start.motion.velocity - 0.5 * noise.gravity * start.motion.up +
                                  last.deltaPosition(start.motion.bias_gyro, start.motion.bias_accel);
    const double error = std::abs(moved.norm() / truth.norm() - 1);
    inside += error < 2 * start.scale_sigma ? 1 : 0;
    believed += start.scale_sigma < 0.2 ? 1 : 0;
    believed_bad += start.scale_sigma < 0.2 && error > 0.4 ? 1 : 0;
  }
  std::printf(
      "mono start, simulated, 1 s: solved %d of %d, scale inside 2 sigma %.0f %%, sigma < 0.2: %d, of them "
      "above "
      "0.4: %d, gyro bias alone %.4f rad/s, worst %.4f, inside 5 sigma %.1f %%, %.1f ms\n",
      solved, runs, 100.0 * inside / solved, believed, believed_bad, bias_error, worst_bias,
      100.0 * bias_inside / runs, milliseconds);
  CHECK(solved > runs * 3 / 4);
  CHECK(inside >= solved * 85 / 100);
  CHECK(believed_bad <= 1);
  CHECK(bias_inside >= runs * 95 / 100);
  CHECK(worst_bias < 0.05);  // from where the start still finds its way: all of them do
}

TEST_CASE("Mono start refuses what does not show scale") {
  const ImuNoise noise;
  const StartPrior prior;
  const SE3 T_body_cam(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d::Zero());
  Random random(8);
  // Rotation alone: refused, or said to be uncertain.
  const AnalyticTrajectory turning(3, 0.0, 0.5);
  const Window w = makeWindow(turning, 8, 0.1, noise, prior, random);
  const std::vector<BearingTrack> tracks = makeTracks(turning, T_body_cam, 8, 0.1, 1.3e-3, random);
  MonoStart start;
  const Status status = solveMonoStart(w.from_first, tracks, T_body_cam, 1.3e-3, w.tilt, noise, prior, start);
  CHECK((!status.ok() || start.scale_sigma > 0.2));
  CHECK(solveMonoStart({}, {}, T_body_cam, 1e-3, w.tilt, noise, prior, start).code == StatusCode::kNotReady);
}
