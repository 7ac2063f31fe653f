// Loops in full smoothing: what true ones buy, what wrong ones must not cost, large drift, epochs.

#include <catch2/catch.hpp>
#include <cstdio>

#include "estimator/smoother/full_smoother.hpp"
#include "tests/smoother/revisit_flight.hpp"
#include "tests/smoother/smoother_run.hpp"

using namespace swiftlet;
using test::RevisitSettings;
using test::TrackFlight;

namespace {

/// A flight's keyframes in a full smoother, not yet solved: copied for each experiment.
struct Prepared {
  std::unique_ptr<TrackFlight> flight;
  std::vector<std::size_t> keyframes;
  std::vector<NavState> causal;
  std::vector<BodyState> truth;
  std::vector<FullSmoother> full;  // one

  [[nodiscard]] std::vector<LoopRevisit> loops(const RevisitSettings& settings) const {
    return trueLoops(*flight, keyframes, settings);
  }
};

FullSmootherSettings fullSettings(const TrackFlight& flight) {
  FullSmootherSettings settings;
  settings.pixel_sigma = flight.flight().settings().tracks.pixel_sigma;
  return settings;
}

Prepared prepared(double duration, std::uint64_t seed) {
  Prepared run;
  run.flight = std::make_unique<TrackFlight>(test::roomFlight(duration, seed));
  const TrackFlight& flight = *run.flight;
  run.full.emplace_back(flight.rig(), flight.noise(), fullSettings(flight));
  test::SmootherRun causal(flight);
  flight.play(
      [&](const ImuSample& sample) {
        causal.addImu(sample);
        run.full[0].addImu(sample);
      },
      [&](std::size_t k) {
        REQUIRE(causal.step(k).ok());
        const TrackedFrame& frame = flight.frames()[k];
        if (!frame.keyframe) return;
        const BodyState& x = causal.smoother().newest().x;
        NavState state;
        state.stamp = frame.stamp;
        state.T_world_body = x.T_world_body;
        state.v_world_body = x.v_world_body;
        state.bias_gyro = x.bias_gyro;
        state.bias_accel = x.bias_accel;
        REQUIRE(run.full[0].addKeyframe(frame, state).ok());
        run.keyframes.push_back(k);
        run.causal.push_back(state);
        run.truth.push_back(flight.truth(k));
      });
  return run;
}

struct Solved {
  double error = 0;  // m
  FullSmootherReport report;
};

Solved solve(const Prepared& run, const std::vector<LoopRevisit>& loops) {
  FullSmoother full = run.full[0];
  for (const LoopRevisit& loop : loops) REQUIRE(full.addRevisit(loop).ok());
  Solved solved;
  REQUIRE(full.solve(solved.report).ok());
  std::vector<NavState> states;
  for (std::size_t k = 0; k < full.size(); ++k) states.push_back(full.state(k));
  solved.error = test::positionError(states, run.truth);
  return solved;
}

}  // namespace

TEST_CASE("Loops make the map better", "[smoother][full_smoother][revisit]") {
  double without_sum = 0;
  double with_sum = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Prepared run = prepared(50, seed);
    const std::vector<LoopRevisit> loops = run.loops({});
    const Solved without = solve(run, {});
    const Solved with = solve(run, loops);
    RevisitSettings wrong;
    wrong.wrong_share = 0.1;
    const Solved wronged = solve(run, run.loops(wrong));
    std::printf(
        "revisits, seed %d: causal %.4f m, full %.4f m, with loops %.4f m, with a tenth wrong %.4f m; %zu of "
        "%zu "
        "loops, %zu of %zu matches; wrong: %zu of %zu\n",
        static_cast<int>(seed), test::positionError(run.causal, run.truth), without.error, with.error,
        wronged.error, with.report.revisits_used, with.report.revisits, with.report.matches_used,
        with.report.matches, wronged.report.matches_used, wronged.report.matches);
    without_sum += without.error;
    with_sum += with.error;
  }
  CHECK(with_sum < 0.7 * without_sum);
}
