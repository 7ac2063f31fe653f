// The odometry stage on simulated tracks: states, epochs, health and events, with every fault a flight
// may bring. Statistics over many flights: flight_statistics.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <set>

#include "estimator/geometry/alignment.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::count;
using test::OdometryRun;
using test::RunFrame;
using test::TrackFlight;
using test::withFault;

namespace {

double ate(const OdometryRun& run) {
  std::vector<Eigen::Vector3d> estimate;
  std::vector<Eigen::Vector3d> truth;
  for (const RunFrame& f : run.frames) {
    if (!f.has_state) continue;
    estimate.push_back(f.state.T_world_body.translation);
    truth.push_back(f.truth.T_world_body.translation);
  }
  Alignment alignment;
  REQUIRE(alignRigid(estimate, truth, alignment).ok());
  return alignment.rms;
}

std::set<Health> healthBetween(const TrackFlight& flight, const OdometryRun& run, double begin, double end) {
  std::set<Health> seen;
  for (const RunFrame& f : run.frames) {
    const double t = flight.seconds(f.index);
    if (t >= begin && t < end) seen.insert(f.state.health);
  }
  return seen;
}

}  // namespace

TEST_CASE("Odometry: every frame has a state, the first at once", "[odometry]") {
  const TrackFlight flight(test::roomFlight(12, 21));
  const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
  for (const RunFrame& f : run.frames) REQUIRE(f.has_state);
  CHECK(ate(run) < 0.05);
  CHECK(run.frames.back().state.health == Health::kGood);
  CHECK(run.frames.back().state.epoch == 0);
  CHECK(count(run, EventKind::kInitialized) == 1);
  CHECK(count(run, EventKind::kReset) == 0);
  CHECK(count(run, EventKind::kCapacityReached) == 0);
}

TEST_CASE("Odometry: one camera starts within 3 s and says what it waits for", "[odometry]") {
  const TrackFlight flight(test::roomFlight(15, 22));
  Odometry odometry(flight.rig(), flight.noise(), test::settingsFor(flight, false));
  auto output = std::make_unique<OdometryOutput>();
  double first = -1;
  bool silent = false;
  flight.play([&](const ImuSample& sample) { static_cast<void>(odometry.addImu(sample)); },
              [&](std::size_t k) {
                static_cast<void>(odometry.smooth(flight.frames()[k], Effort{}, *output));
                if (output->has_state && first < 0) first = flight.seconds(k) - flight.seconds(0);
                if (!output->has_state && output->waiting_for[0] == '\0') silent = true;
              });
  CHECK_FALSE(silent);
  CHECK(first >= 0);
  CHECK(first <= 3.0);
}

TEST_CASE("Odometry: a camera of 2 to 4 Hz flies and is called good", "[odometry]") {
  for (const double rate : {2.0, 3.0, 4.0}) {
    CAPTURE(rate);
    SimulationSettings settings = test::roomFlight(20, 22);
    settings.camera_rate = rate;
    const TrackFlight flight(settings);
    Odometry odometry(flight.rig(), flight.noise(), test::settingsFor(flight));
    auto output = std::make_unique<OdometryOutput>();
    int propagated_good = 0;
    int propagated = 0;
    std::vector<RunFrame> frames;
    flight.play(
        [&](const ImuSample& sample) {
          NavState state;
          if (!odometry.addImu(sample, &state).ok() ||
              flight.frames()[0].stamp + Duration::fromSeconds(5) > sample.stamp)
            return;
          ++propagated;
          propagated_good += state.health == Health::kGood ? 1 : 0;
        },
        [&](std::size_t k) {
          REQUIRE(odometry.smooth(flight.frames()[k], Effort{}, *output).ok());
          RunFrame frame;
          frame.index = k;
          frame.seconds = flight.seconds(k) - flight.seconds(0);
          frame.truth = flight.truth(k);
          test::take(*output, frame);
          frames.push_back(frame);
        });
    std::printf("two cameras at %.0f Hz: ATE %.4f m, %d of %d propagated states good\n", rate,
                test::ate(frames), propagated_good, propagated);
    CHECK(propagated_good > 0.9 * propagated);
    CHECK(test::ate(frames) < 0.1);
  }
}

TEST_CASE("Odometry: one camera finds the scale", "[odometry]") {
  for (const std::uint64_t seed : {22, 29, 30}) {
    const TrackFlight flight(test::roomFlight(15, seed));
    const OdometryRun run = test::runOdometry(flight, test::settingsFor(flight, false));
    // Speed is what the scale multiplies, and does not depend on the world's axes.
    const auto speedRatio = [&run](double begin, double end) {
      double estimate = 0;
      double truth = 0;
      for (const RunFrame& f : run.frames) {
        if (!f.has_state || f.seconds < begin || f.seconds >= end) continue;
        estimate += f.state.v_world_body.norm();
        truth += f.truth.v_world_body.norm();
      }
      return truth > 0 ? estimate / truth : 0.0;
    };
    const double at_start = speedRatio(0, 4);
    const double later = speedRatio(10, 15);
    std::printf("one camera, seed %d: speed over truth %.3f at the start, %.3f after 10 s, ATE %.4f m\n",
                static_cast<int>(seed), at_start, later, ate(run));
    // A start is taken when the scale's sigma is below 10 %: three of them; then it only gets better.
    CHECK(std::abs(at_start - 1) < 0.3);
    CHECK(std::abs(later - 1) < 0.1);
    CHECK(ate(run) < 0.1);
  }
}

TEST_CASE("Odometry: a reset in flight starts a new epoch and loses no keyframe", "[odometry]") {
  const TrackFlight flight(test::roomFlight(12, 23));
  Odometry odometry(flight.rig(), flight.noise(), OdometrySettings{});
  auto output = std::make_unique<OdometryOutput>();
  constexpr std::size_t kResetAt = 120;
  std::vector<std::uint32_t> epochs;
  std::vector<std::int64_t> delivered;
  std::size_t keyframes = 0;
  const auto take = [&] {
    for (const KeyframeState& keyframe : output->left_window) {
      delivered.push_back(keyframe.state.stamp.ns);
      CHECK(keyframe.state.epoch == (keyframe.state.stamp < flight.frames()[kResetAt].stamp ? 0U : 1U));
    }
  };
  flight.play([&](const ImuSample& sample) { static_cast<void>(odometry.addImu(sample)); },
              [&](std::size_t k) {
                if (k == kResetAt) odometry.reset();
                REQUIRE(odometry.smooth(flight.frames()[k], Effort{}, *output).ok());
                REQUIRE(output->has_state);
                epochs.push_back(output->state.epoch);
                keyframes += flight.frames()[k].keyframe || k == 0 || k == kResetAt ? 1 : 0;
                take();
              });
  odometry.finish(*output);
  take();
  CHECK(epochs.front() == 0);
  CHECK(epochs[kResetAt - 1] == 0);
  CHECK(epochs[kResetAt] == 1);
  CHECK(epochs.back() == 1);
  CHECK(std::set<std::int64_t>(delivered.begin(), delivered.end()).size() == delivered.size());
  CHECK(delivered.size() == keyframes);
}

TEST_CASE("Odometry: where there is no solution the next epoch goes on at the same place", "[odometry]") {
  const TrackFlight flight(test::roomFlight(12, 23));
  Odometry odometry(flight.rig(), flight.noise(), OdometrySettings{});
  auto output = std::make_unique<OdometryOutput>();
  int failed = 0;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  flight.play(
      [&](const ImuSample& given) {
        ImuSample sample = given;
        if (sample.stamp == flight.frames()[120].stamp) sample.accel.setConstant(1e200);  // breaks all sums
        static_cast<void>(odometry.addImu(sample));
      },
      [&](std::size_t k) {
        const Status status = odometry.smooth(flight.frames()[k], Effort{}, *output);
        failed += status.ok() ? 0 : 1;
        if (!output->has_state) return;
        if (k > 0) CHECK((output->state.T_world_body.translation - last).norm() < 0.3);
        last = output->state.T_world_body.translation;
      });
  CHECK(failed > 0);
  CHECK(output->state.epoch > 0);
  CHECK(output->state.health == Health::kGood);
  CHECK(last.norm() > 1);
}

TEST_CASE("Odometry: one camera lost is degraded, not reset, and taken back", "[odometry][fault]") {
  for (const int camera : {0, 1}) {
    INFO("camera " << camera);
    const TrackFlight flight(
        withFault(test::roomFlight(14, 24), {FaultKind::kCameraMissing, {5, 10}, camera}));
    const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
    CHECK(healthBetween(flight, run, 5, 10) == std::set{Health::kDegraded});
    CHECK(healthBetween(flight, run, 10.5, 14) == std::set{Health::kGood});
    CHECK(count(run, EventKind::kCameraLost) == 1);
    CHECK(count(run, EventKind::kCameraBack) == 1);
    CHECK(run.frames.back().state.epoch == 0);
    CHECK(ate(run) < 0.05);
  }
}

TEST_CASE("Odometry: dark for 2 s it coasts, for 4 s it says failed; both end well", "[odometry][fault]") {
  for (const double dark : {2.0, 4.0}) {
    INFO("dark for " << dark << " s");
    const TrackFlight flight(withFault(test::roomFlight(16, 25), {FaultKind::kBlackout, {8, 8 + dark}, -1}));
    const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
    CHECK(healthBetween(flight, run, 8.5, 8 + std::min(dark, 2.9)) == std::set{Health::kDegraded});
    if (dark > 3) CHECK(healthBetween(flight, run, 11.2, 8 + dark) == std::set{Health::kFailed});
    CHECK(healthBetween(flight, run, 8 + dark + 1, 16).count(Health::kFailed) == 0);
    CHECK(run.frames.back().state.health == Health::kGood);
    CHECK(count(run, EventKind::kBlackoutStarted) == 1);
    CHECK(count(run, EventKind::kBlackoutEnded) == 1);
    if (dark > 3) CHECK(run.frames.back().state.epoch == 1);
    CHECK(ate(run) < 0.25);
  }
}

TEST_CASE("Odometry: an IMU gap of 1 s is told, degrades, and is recovered from", "[odometry][fault]") {
  const TrackFlight flight(withFault(test::roomFlight(14, 26), {FaultKind::kImuGap, {6, 7}, -1}));
  const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
  CHECK(count(run, EventKind::kImuGap) == 1);
  CHECK(healthBetween(flight, run, 6.2, 7.0) == std::set{Health::kDegraded});
  // Ten images until what drifted has settled.
  CHECK(healthBetween(flight, run, 7.1, 7.4) == std::set{Health::kDegraded});
  CHECK(healthBetween(flight, run, 7.6, 14) == std::set{Health::kGood});
  CHECK(ate(run) < 0.1);
}

TEST_CASE("Odometry: samples that are not finite or go back are dropped and told", "[odometry][fault]") {
  const TrackFlight flight(test::roomFlight(6, 27));
  Odometry odometry(flight.rig(), flight.noise(), OdometrySettings{});
  auto output = std::make_unique<OdometryOutput>();
  int told = 0;
  int given = 0;
  ImuSample previous;
  flight.play(
      [&](const ImuSample& sample) {
        static_cast<void>(odometry.addImu(sample));
        if (++given % 200 == 100) {
          ImuSample bad = sample;
          bad.stamp = sample.stamp + Duration::fromMilliseconds(1);
          bad.gyro.x() = std::nan("");
          CHECK_FALSE(odometry.addImu(bad).ok());
          CHECK_FALSE(odometry.addImu(previous).ok());
        }
        previous = sample;
      },
      [&](std::size_t k) {
        REQUIRE(odometry.smooth(flight.frames()[k], Effort{}, *output).ok());
        REQUIRE(output->state.T_world_body.translation.allFinite());
        for (const Event& e : output->events) told += e.kind == EventKind::kImuInvalid ? 1 : 0;
      });
  CHECK(told >= 2 * (given / 200) - 2);
  CHECK(output->state.health == Health::kGood);
}

TEST_CASE("Odometry: finds a time offset, none, a small one and one of two prior sigmas",
          "[odometry][calibration]") {
  // A prior of 5 ms weighs nothing against what 25 s of lively flight show: what is found does not depend on
  // how far off the calibration was.
  for (const double offset : {0.0, 1.5e-3, -4e-3, 10e-3, -10e-3}) {
    INFO("offset " << offset << " s");
    SimulationSettings settings = test::roomFlight(25, 28);
    settings.flight.aggressiveness = 1.5;
    settings.image_stamp_offset = Duration::fromSeconds(offset);
    const TrackFlight flight(settings);
    OdometrySettings with = test::settingsFor(flight);
    with.estimate_time_offset = true;
    const OdometryRun run = test::runOdometry(flight, with);
    CHECK(run.frames.back().calibration.camera_to_imu_shift.seconds() == Approx(-offset).margin(3e-4));
  }
}

TEST_CASE("Odometry: finds a time offset of many of the IMU's periods", "[odometry][calibration]") {
  SimulationSettings settings = test::roomFlight(15, 28);
  settings.imu.noise.rate_hz = 1000;
  settings.image_stamp_offset = Duration::fromSeconds(-12e-3);
  const TrackFlight flight(settings);
  OdometrySettings with = test::settingsFor(flight);
  with.estimate_time_offset = true;
  const OdometryRun run = test::runOdometry(flight, with);
  CHECK(run.frames.back().calibration.camera_to_imu_shift.seconds() == Approx(12e-3).margin(5e-4));
  CHECK(run.frames.back().state.health == Health::kGood);
}

// 45 ms without samples from between two of them to between two images: one segment.
TEST_CASE("Odometry: an interval without a sample inside is no end of the estimate", "[odometry]") {
  SimulationSettings settings = test::roomFlight(12, 28);
  settings.faults.push_back({FaultKind::kImuGap, {6.001, 6.047}, -1});
  const TrackFlight flight(settings);
  const OdometryRun run = test::runOdometry(flight, test::settingsFor(flight));
  CHECK(run.frames.back().state.epoch == 0);
  CHECK(run.frames.back().state.health == Health::kGood);
}
