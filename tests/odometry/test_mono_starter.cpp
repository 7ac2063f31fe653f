// The start with one camera: fast cameras, and a calibration that was estimated before.

#include "estimator/odometry/mono_starter.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <memory>
#include <optional>

#include "estimator/odometry/odometry_inputs.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::TrackFlight;

namespace {

SimulationSettings monoFlight(double seconds, std::uint64_t seed) {
  SimulationSettings settings = test::roomFlight(seconds, seed);
  settings.mono = true;
  return settings;
}

/// Errors of the first start of a flight, solved with the calibration.
struct StartError {
  double velocity = -1;  ///< m/s
  double tilt = -1;      ///< rad
};

StartError startWith(const TrackFlight& flight, const CalibrationEstimate& calibration) {
  MonoStarter starter(flight.rig(), flight.noise());
  ImuBuffer imu(kImuHistory);
  StartError error;
  flight.play([&](const ImuSample& sample) { imu.push(sample); },
              [&](std::size_t k) {
                if (error.velocity >= 0 || flight.seconds(k) < flight.seconds(0) + 0.5) return;
                StartState start;
                const char* waiting_for = "";
                starter.push(flight.frames()[k]);
                if (!starter.trySolve(imu, {}, {}, calibration, 1.0, start, waiting_for)) return;
                test::RunFrame frame;
                frame.state.T_world_body = start.state.T_world_body;
                frame.state.v_world_body = start.state.v_world_body;
                frame.truth = flight.truth(k + 1 - starter.size());
                error = {test::velocityError(frame), test::tiltError(frame)};
              });
  return error;
}

}  // namespace

TEST_CASE("Odometry: one camera starts within 3 s at any rate", "[odometry]") {
  for (const double rate : {10.0, 30.0, 60.0, 200.0}) {
    CAPTURE(rate);
    SimulationSettings settings = monoFlight(4, 22);
    settings.camera_rate = rate;
    settings.imu.noise.rate_hz = 500;  // more samples than images
    const TrackFlight flight(settings);
    const test::OdometryRun run = test::runOdometry(flight, test::settingsFor(flight, false));
    const auto first = std::ranges::find(run.frames, true, &test::RunFrame::has_state);
    REQUIRE(first != run.frames.end());
    const double speed = first->state.v_world_body.norm() / first->truth.v_world_body.norm();
    std::printf("one camera at %3.0f Hz: first state after %.2f s, speed over truth %.3f\n", rate,
                first->seconds, speed);
    CHECK(first->seconds <= 3.0);
    CHECK(std::abs(speed - 1) < 0.3);
  }
}

TEST_CASE("MonoStarter: its patience ends at every frame rate", "[odometry]") {
  const TrackFlight flight(test::roomFlight(5, 40));
  ImuBuffer imu(kImuHistory);
  flight.play([&](const ImuSample& sample) { imu.push(sample); }, [](std::size_t) {});
  for (const double rate : {20.0, 30.0, 60.0, 200.0, 500.0}) {
    INFO(rate << " Hz");
    MonoStarter starter(flight.rig(), flight.noise());
    std::optional<double> waited;
    for (int k = 0; k < 4 * rate && !waited; ++k) {
      TrackedFrame frame;  // without tracks
      frame.stamp = flight.frames()[0].stamp + Duration::fromSeconds(k / rate);
      starter.push(frame);
      StartState start;
      const char* why = "";
      StartPrior prior;
      prior.bias_gyro = Eigen::Vector3d(0.01, -0.02, 0.03);
      prior.bias_accel = Eigen::Vector3d(0.1, 0.2, -0.3);
      if (!starter.trySolve(imu, Stamp{}, prior, {}, 0.45, start, why)) continue;
      waited = k / rate;
      CHECK(start.state.bias_gyro == prior.bias_gyro);
      CHECK(start.state.bias_accel == prior.bias_accel);
    }
    REQUIRE(waited);
    // Of a fast camera not every frame is kept.
    CHECK(*waited == Approx(kMonoPatience.seconds()).margin(std::max(1.01 / rate, 0.09)));
  }
}

TEST_CASE("the start with one camera keeps frames of all the time that it waits, and keyframes") {
  const Rig rig = TrackFlight(monoFlight(1, 1)).rig();
  for (const int rate : {20, 60, 200, 500}) {
    CAPTURE(rate);
    MonoStarter starter(rig, {});
    auto frame = std::make_unique<TrackedFrame>();
    const int frames = static_cast<int>(2.5 * rate);
    for (int i = 0; i < frames; ++i) {
      frame->stamp = {static_cast<std::int64_t>(i) * 1'000'000'000 / rate};
      frame->keyframe = i % (rate / 4) == 1;
      starter.push(*frame);
    }
    REQUIRE(starter.size() >= 32);
    CHECK(starter.frame(0).stamp.ns == 0);
    std::size_t keyframes = 0;
    for (std::size_t k = 0; k < starter.size(); ++k) {
      keyframes += starter.frame(k).keyframe ? 1 : 0;
      if (k == 0) continue;
      const double gap = (starter.frame(k).stamp - starter.frame(k - 1).stamp).seconds();
      CHECK(gap > 0);
      CHECK(gap < 0.1);
    }
    CHECK(keyframes == 10);
  }
}

TEST_CASE("the start with one camera uses the calibration as estimated") {
  constexpr double kLate = 0.03;  // s, which the given calibration does not know
  SimulationSettings settings = monoFlight(6, 22);
  settings.flight.aggressiveness = 1.5;
  settings.image_stamp_offset = Duration::fromSeconds(kLate);
  const TrackFlight flight(settings);
  CalibrationEstimate calibration;
  calibration.T_body_cam = flight.rig().T_body_cam;
  const StartError given = startWith(flight, calibration);
  calibration.camera_to_imu_shift = Duration::fromSeconds(-kLate);
  const StartError estimated = startWith(flight, calibration);
  std::printf("start with images 30 ms late: %.3f m/s and %.4f rad off, %.3f m/s and %.4f rad if estimated\n",
              given.velocity, given.tilt, estimated.velocity, estimated.tilt);
  REQUIRE(given.velocity >= 0);
  REQUIRE(estimated.velocity >= 0);
  CHECK(estimated.velocity < 0.2);
  CHECK(estimated.velocity < given.velocity);
  CHECK(estimated.tilt < given.tilt);
}
