// Starts on simulated data with exact truth: tilt, and in motion with one camera.

#include "estimator/imu/initialization.hpp"

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/mono_start.hpp"
#include "tests/imu/analytic_trajectory.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

const Eigen::Vector3d kStartBiasGyro(0.01, -0.02, 0.05);
const Eigen::Vector3d kStartBiasAccel(0.05, -0.08, 0.03);

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
  w.samples = path.samples(0.5, 1.005 + frames * interval, noise, kStartBiasGyro, kStartBiasAccel, &random);
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

TEST_CASE("Tilt: refused without samples and in free fall") {
  const ImuNoise noise;
  TiltEstimate tilt;
  CHECK(estimateTilt({}, stampOf(1), noise, {}, tilt).code == StatusCode::kInvalidInput);
  const std::vector<ImuSample> falling{{stampOf(0.9), Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 0, 0.5)}};
  CHECK(estimateTilt(falling, stampOf(1), noise, {}, tilt).code == StatusCode::kDegenerate);
}

TEST_CASE("Tilt: a vehicle that manoeuvres is told from one that stands by its sigma", "[figures]") {
  const ImuNoise noise;
  Random random(12);
  double stands = 0;
  for (const double acceleration : {0.0, 1.8}) {  // m/s^2 per level axis, anew every 0.3 s
    double errors = 0, sigmas = 0;
    constexpr int kStarts = 400;
    for (int start = 0; start < kStarts; ++start) {
      std::vector<ImuSample> samples;
      Eigen::Vector3d moving = Eigen::Vector3d::Zero();
      for (int i = 0; i < 180; ++i) {
        if (i % 60 == 0) moving = acceleration * Eigen::Vector3d(random.normal(), random.normal(), 0);
        samples.push_back({stampOf(1 - 0.005 * (180 - i)), Eigen::Vector3d::Zero(),
                           moving + Eigen::Vector3d(0, 0, noise.gravity)});
      }
      TiltEstimate tilt;
      REQUIRE(estimateTilt(samples, stampOf(1), noise, {}, tilt).ok());
      errors += std::pow(angle(tilt.up, Eigen::Vector3d::UnitZ()), 2) / 2;
      sigmas += tilt.sigma * tilt.sigma;
    }
    const double error = std::sqrt(errors / kStarts), sigma = std::sqrt(sigmas / kStarts);
    std::printf("tilt, accelerations of %.1f m/s^2: error %.4f rad per axis, sigma %.4f\n", acceleration,
                error, sigma);
    CHECK(error < 2 * sigma);
    if (acceleration == 0) stands = sigma;
    if (acceleration > 0) CHECK(sigma > 1.5 * stands);
  }
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
    bias_error += (bias - kStartBiasGyro).norm() / runs;
    bias_inside += (bias - kStartBiasGyro).norm() < 5 * bias_sigma ? 1 : 0;
    worst_bias = std::max(worst_bias, (bias - kStartBiasGyro).norm());
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
