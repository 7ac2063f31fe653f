// Flights that see nothing for a while, with the IMU and without: what is called good afterwards is right,
// because a new epoch begins where the one before can no longer say how the body came here.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <set>
#include <vector>

#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::count;
using test::OdometryRun;
using test::RunFrame;
using test::TrackFlight;
using test::withFault;

namespace {

/// The worst error of the motion over 10 images, 0.5 s, of those that are all good and of one epoch [m].
double worstGoodMotion(const OdometryRun& run) {
  constexpr std::size_t kApart = 10;
  double worst = 0;
  std::size_t good = 0;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const RunFrame& b = run.frames[i];
    good = b.has_state && b.state.health == Health::kGood ? good + 1 : 0;
    if (i < kApart || good <= kApart) continue;
    const RunFrame& a = run.frames[i - kApart];
    if (a.state.epoch != b.state.epoch) continue;
    const SE3 truth = a.truth.T_world_body.inverse() * b.truth.T_world_body;
    const SE3 estimate = a.state.T_world_body.inverse() * b.state.T_world_body;
    worst = std::max(worst, (truth.inverse() * estimate).translation.norm());
  }
  return worst;
}

const RunFrame& firstOfEpoch(const OdometryRun& run, std::uint32_t epoch) {
  const auto found = std::ranges::find_if(
      run.frames, [&](const RunFrame& f) { return f.has_state && f.state.epoch == epoch; });
  REQUIRE(found != run.frames.end());
  return *found;
}

}  // namespace

TEST_CASE("Odometry: a blackout is bridged while places are known again, else a new epoch begins",
          "[odometry][fault]") {
  for (const std::uint64_t seed : {31U, 32U, 33U}) {
    for (const double dark : {0.8, 5.0}) {
      INFO("dark for " << dark << " s, seed " << seed);
      const TrackFlight flight(
          withFault(test::roomFlight(14, seed), {FaultKind::kBlackout, {6, 6 + dark}, -1}));
      const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
      const std::uint32_t epochs = dark > 3 ? 1 : 0;
      CHECK(count(run, EventKind::kReset) == static_cast<int>(epochs));
      CHECK(run.frames.back().state.epoch == epochs);
      CHECK(run.frames.back().state.health == Health::kGood);
      CHECK(count(run, EventKind::kBlackoutEnded) == 1);
      CHECK(worstGoodMotion(run) < 0.04);
    }
  }
}

TEST_CASE("Odometry: after blackness with the IMU a new epoch knows velocity, tilt and biases",
          "[odometry][fault]") {
  const TrackFlight flight(withFault(test::roomFlight(14, 34), {FaultKind::kBlackout, {6, 10}, -1}));
  const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
  const RunFrame& first = firstOfEpoch(run, 1);
  const RunFrame& before = run.frames[first.index - 1];
  CHECK(test::velocityError(first) < 0.2);
  CHECK(test::tiltError(first) < 0.02);
  CHECK((first.state.bias_gyro - before.state.bias_gyro).norm() < 1e-3);
  CHECK((first.state.bias_accel - before.state.bias_accel).norm() < 0.05);
  // The pose goes on where the body was thought to be.
  const double step = (first.state.T_world_body.translation - before.state.T_world_body.translation).norm();
  CHECK(step < 0.2);
}

TEST_CASE("Odometry: with one camera a new epoch keeps the gyro's bias", "[odometry][fault]") {
  for (const std::uint64_t seed : {34U, 38U}) {
    INFO("seed " << seed);
    SimulationSettings settings = withFault(test::roomFlight(16, seed), {FaultKind::kBlackout, {9, 10}, -1});
    settings.mono = true;
    const TrackFlight flight(withFault(settings, {FaultKind::kImuGap, {9, 10}, -1}));
    OdometrySettings one;
    one.use_stereo = false;
    const OdometryRun run = test::runOdometry(flight, one);
    const RunFrame& first = firstOfEpoch(run, 1);
    const auto before = std::find_if(run.frames.rbegin(), run.frames.rend(),
                                     [](const RunFrame& f) { return f.has_state && f.state.epoch == 0; });
    REQUIRE(before != run.frames.rend());
    CHECK((first.state.bias_gyro - before->state.bias_gyro).norm() < 5e-3);
  }
}

TEST_CASE("Odometry: after seconds without frames each keyframe is delivered once", "[odometry][fault]") {
  const TrackFlight flight(test::roomFlight(12, 39));
  Odometry odometry(flight.rig(), flight.noise(), OdometrySettings{});
  auto output = std::make_unique<OdometryOutput>();
  std::vector<std::int64_t> delivered;
  std::uint32_t epoch = 0;
  const auto take = [&] {
    for (const KeyframeState& keyframe : output->left_window) delivered.push_back(keyframe.state.stamp.ns);
  };
  flight.play([&](const ImuSample& sample) { static_cast<void>(odometry.addImu(sample)); },
              [&](std::size_t k) {
                if (flight.seconds(k) > 6 && flight.seconds(k) < 8) return;
                TrackedFrame frame = flight.frames()[k];
                if (flight.seconds(k) >= 8) {
                  // Nothing is recognized.
                  for (TrackedFeature& feature : frame.features) feature.id += 1'000'000;
                }
                REQUIRE(odometry.smooth(frame, Effort{}, *output).ok());
                epoch = output->state.epoch;
                take();
              });
  odometry.finish(*output);
  take();
  CHECK(epoch == 1);
  CHECK(std::set<std::int64_t>(delivered.begin(), delivered.end()).size() == delivered.size());
}

TEST_CASE("Odometry: neither images nor samples for a while begin a new epoch", "[odometry][fault]") {
  for (const std::uint64_t seed : {35U, 36U, 37U}) {
    for (const double gone : {0.5, 1.4, 3.5}) {
      INFO("for " << gone << " s, seed " << seed);
      const SimulationSettings dark =
          withFault(test::roomFlight(14, seed), {FaultKind::kBlackout, {6, 6 + gone}, -1});
      const TrackFlight flight(withFault(dark, {FaultKind::kImuGap, {6, 6 + gone}, -1}));
      const OdometryRun run = test::runOdometry(flight, OdometrySettings{});
      CHECK(run.frames.back().state.epoch == 1);
      CHECK(run.frames.back().state.health == Health::kGood);
      CHECK(worstGoodMotion(run) < 0.04);
    }
  }
}
