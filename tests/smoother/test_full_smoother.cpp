// Full smoothing on simulated tracks, against the causal estimate it starts from.

#include "estimator/smoother/full_smoother.hpp"

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdio>
#include <string>

#include "tests/smoother/smoother_run.hpp"

using namespace swiftlet;
using test::TrackFlight;

namespace {

struct FullRun {
  std::vector<NavState> causal;  // at keyframes
  std::vector<NavState> full;
  std::vector<NavState> full_given;  // with the given calibration, where it was estimated
  std::vector<BodyState> truth;
  FullSmootherReport report;
  Status status;
};

std::vector<NavState> statesOf(const FullSmoother& full) {
  std::vector<NavState> states;
  for (std::size_t k = 0; k < full.size(); ++k) states.push_back(full.state(k));
  return states;
}

/// `scale`: by how much the states are too large that full smoothing starts from.
FullRun runFull(const TrackFlight& flight, const SmootherSettings& causal_settings, double scale = 1) {
  FullRun run;
  FullSmoother full(flight.rig(), flight.noise(), {});
  test::SmootherRun causal(flight, causal_settings);
  flight.play(
      [&](const ImuSample& sample) {
        causal.addImu(sample);
        full.addImu(sample);
      },
      [&](std::size_t k) {
        REQUIRE(causal.step(k).ok());
        const TrackedFrame& frame = flight.frames()[k];
        if (!frame.keyframe) return;
        NavState state;
        state.stamp = frame.stamp;
        const BodyState& x = causal.smoother().newest().x;
        state.T_world_body = x.T_world_body;
        state.T_world_body.translation *= scale;
        state.v_world_body = scale * x.v_world_body;
        state.bias_gyro = x.bias_gyro;
        state.bias_accel = x.bias_accel;
        full.addKeyframe(frame, state, causal.smoother().newest().statistics.noise);
        run.causal.push_back(state);
        run.truth.push_back(flight.truth(k));
      });
  if (causal_settings.estimate_time_offset || causal_settings.estimate_extrinsics ||
      causal_settings.estimate_gyro) {
    FullSmoother given = full;
    REQUIRE(given.solve(run.report).ok());
    run.full_given = statesOf(given);
    full.setCalibration(causal.smoother().calibration());
  }
  run.status = full.solve(run.report);
  run.full = statesOf(full);
  return run;
}

FullRun runFull(const TrackFlight& flight) { return runFull(flight, test::settingsFor(flight)); }

// As the flight says whose calibration was given wrongly.
void checkEstimateUsed(const SimulationSettings& flown, bool time_offset, bool extrinsics, bool gyro) {
  const TrackFlight flight(flown);
  SmootherSettings settings = test::settingsFor(flight);
  settings.estimate_time_offset = time_offset;
  settings.estimate_extrinsics = extrinsics;
  settings.estimate_gyro = gyro;
  const FullRun run = runFull(flight, settings);
  REQUIRE(run.status.ok());
  const double causal = test::positionError(run.causal, run.truth);
  const double given = test::positionError(run.full_given, run.truth);
  const double full = test::positionError(run.full, run.truth);
  std::printf("calibration given wrongly: causal %.4f m, full %.4f m, full with what was given %.4f m\n",
              causal, full, given);
  CHECK(full < causal * 1.05 + 1e-3);
  CHECK(full < 0.7 * given);
}

}  // namespace

TEST_CASE("Full smoothing is at least as good as the causal estimate", "[smoother][full_smoother]") {
  double causal_sum = 0;
  double full_sum = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const TrackFlight flight(test::roomFlight(20, seed));
    const FullRun run = runFull(flight);
    REQUIRE(run.status.ok());
    const double causal = test::positionError(run.causal, run.truth);
    const double full = test::positionError(run.full, run.truth);
    std::printf("full smoothing, seed %d: causal %.4f m, full %.4f m, %d iterations, cost %.0f to %.0f\n",
                static_cast<int>(seed), causal, full, run.report.iterations, run.report.initial_cost,
                run.report.final_cost);
    CHECK(full < causal * 1.05 + 1e-3);
    CHECK(run.report.final_cost < run.report.initial_cost);
    CHECK(run.report.keyframes == run.causal.size());
    causal_sum += causal;
    full_sum += full;
  }
  CHECK(full_sum < causal_sum);
}

TEST_CASE("Full smoothing goes on from the estimated calibration", "[smoother][full_smoother]") {
  SimulationSettings flown = test::roomFlight(20, 5);
  flown.flight.aggressiveness = 1.5;
  for (const double sign : {1.0, -1.0}) {
    SimulationSettings late = flown;
    late.image_stamp_offset = Duration::fromSeconds(sign * 5e-3);
    checkEstimateUsed(late, true, false, false);
  }
  SimulationSettings bent = flown;
  bent.rig_turn_deg = 0.5 * Eigen::Vector3d(1, -1, 1).normalized();
  checkEstimateUsed(bent, false, true, false);
  SimulationSettings scaled = flown;
  scaled.imu.gyro_matrix *= 1.03;
  checkEstimateUsed(scaled, false, false, true);
}

TEST_CASE("Full smoothing finds one camera's scale again", "[smoother][full_smoother]") {
  SimulationSettings flown = test::roomFlight(40, 7);
  flown.world.kind = WorldKind::kHall;
  flown.mono = true;
  const TrackFlight flight(flown);
  const SmootherSettings settings = test::settingsFor(flight);
  const FullRun right = runFull(flight, settings);
  const FullRun wrong = runFull(flight, settings, 1.1);
  REQUIRE(right.status.ok());
  REQUIRE(wrong.status.ok());
  std::printf("one camera, scale 10 %% off at the start: cost %.1f, from the causal scale %.1f\n",
              wrong.report.final_cost, right.report.final_cost);
  CHECK(std::abs(wrong.report.final_cost / right.report.final_cost - 1) < 1e-3);
  // The first keyframe stays where it was put.
  const auto moved = [](const FullRun& run, std::size_t k) {
    return Eigen::Vector3d(run.full[k].T_world_body.translation - run.full[0].T_world_body.translation);
  };
  for (std::size_t k = 0; k < right.full.size(); ++k) {
    INFO("keyframe " << k);
    REQUIRE((moved(wrong, k) - moved(right, k)).norm() < 0.01);
  }
}

TEST_CASE("Full smoothing of a rolling shutter", "[smoother][full_smoother]") {
  SimulationSettings flown = test::roomFlight(20, 6);
  flown.flight.aggressiveness = 1.5;
  flown.render.readout = 0.02;
  const FullRun run = runFull(TrackFlight(flown));
  REQUIRE(run.status.ok());
  const double causal = test::positionError(run.causal, run.truth);
  const double full = test::positionError(run.full, run.truth);
  std::printf("rolling shutter: causal %.4f m, full %.4f m\n", causal, full);
  CHECK(full < causal * 1.05 + 1e-3);
  CHECK(full < 0.02);
}

TEST_CASE("Full smoothing gives the same bytes twice", "[smoother][full_smoother]") {
  const TrackFlight flight(test::roomFlight(6, 4));
  const FullRun a = runFull(flight);
  const FullRun b = runFull(flight);
  REQUIRE(a.status.ok());
  REQUIRE(a.full.size() == b.full.size());
  for (std::size_t k = 0; k < a.full.size(); ++k) {
    CHECK(a.full[k].T_world_body.translation == b.full[k].T_world_body.translation);
    CHECK(a.full[k].T_world_body.rotation.coeffs() == b.full[k].T_world_body.rotation.coeffs());
    CHECK(a.full[k].bias_accel == b.full[k].bias_accel);
  }
}

TEST_CASE("Full smoothing refuses what it cannot solve", "[smoother][full_smoother]") {
  const TrackFlight flight(test::roomFlight(1, 5));
  FullSmoother full(flight.rig(), flight.noise(), {});
  FullSmootherReport report;
  CHECK(full.solve(report).code == StatusCode::kNotReady);
  NavState state;
  full.addKeyframe(flight.frames()[0], state, {});
  full.addKeyframe(flight.frames()[1], state, {});
  CHECK(full.size() == 2);
  CHECK(full.solve(report).code == StatusCode::kNotReady);
}

TEST_CASE("full smoothing's memory is linear in the keyframes, at rest too") {
  // The same landmarks in every keyframe: without an end of their tracks each would be tied to all others.
  const auto needed = [](std::size_t keyframes) {
    const TrackFlight flight(test::roomFlight(1, 1));
    FullSmoother full(flight.rig(), flight.noise(), {});
    TrackedFrame frame;
    for (TrackId id = 0; id < 50; ++id) {
      TrackedFeature feature;
      feature.id = id;
      feature.seen = {true, false};
      feature.pixel[0] = {100.0F + 5.0F * static_cast<float>(id), 200.0F};
      REQUIRE(frame.features.tryPushBack(feature));
    }
    for (std::size_t k = 0; k < keyframes; ++k) {
      frame.stamp = {static_cast<std::int64_t>(k + 1) * 1'000'000'000};
      full.addKeyframe(frame, NavState{}, {});
    }
    return static_cast<double>(full.memoryNeeded());
  };
  const double few = needed(400);
  CHECK(needed(800) < 2.2 * few);
  CHECK(needed(1600) < 4.4 * few);
}

TEST_CASE("a full smoother that is told to stop ends between two landmarks") {
  const TrackFlight flight(test::roomFlight(4, 1));
  FullSmoother full(flight.rig(), flight.noise(), {});
  flight.play([&](const ImuSample& sample) { full.addImu(sample); },
              [&](std::size_t k) {
                const BodyState x = flight.truth(k);
                NavState state;
                state.stamp = flight.frames()[k].stamp;
                state.T_world_body = x.T_world_body;
                state.v_world_body = x.v_world_body;
                full.addKeyframe(flight.frames()[k], state, {});
              });
  FullSmootherReport report;
  std::atomic<bool> stop{true};
  const Status status = full.solve(report, &stop);
  CHECK_FALSE(status.ok());
  CHECK(std::string(status.what) == kFullSmoothingStopped);
  stop = false;
  CHECK(full.solve(report, &stop).ok());
}
