// Loops in full smoothing: what true ones buy, what wrong ones must not cost, large drift, epochs.

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "estimator/geometry/so3.hpp"
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

/// From `cut` seconds on the odometry is in its second epoch, whose world is T_second_first from the first.
Prepared prepared(double duration, std::uint64_t seed, double cut = 1e9, const SE3& T_second_first = {}) {
  Prepared run;
  SimulationSettings settings = test::roomFlight(duration, seed);
  settings.tracks.max_tracks = 80;  // few, of as few landmarks: quick, and visits share as many
  settings.tracks.landmarks = 2000;
  run.flight = std::make_unique<TrackFlight>(settings);
  const TrackFlight& flight = *run.flight;
  run.full.emplace_back(flight.rig(), flight.noise(), FullSmootherSettings{});
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
        if (flight.seconds(k) > cut) {
          state.epoch = 1;
          state.T_world_body = T_second_first * state.T_world_body;
          state.v_world_body = T_second_first.rotation * state.v_world_body;
        }
        run.full[0].addKeyframe(frame, state, causal.smoother().newest().statistics.noise);
        run.keyframes.push_back(k);
        run.causal.push_back(state);
        run.truth.push_back(flight.truth(k));
      });
  return run;
}

const Prepared& firstFlight() {
  static const Prepared run = prepared(28, 1);
  return run;
}

double share(std::size_t part, std::size_t whole) {
  return static_cast<double>(part) / static_cast<double>(whole);
}

struct Solved {
  double error = 0;  // m
  FullSmootherReport report;
  std::vector<NavState> states;
  std::vector<std::uint32_t> worlds;
};

Solved solve(FullSmoother full, const std::vector<LoopRevisit>& loops, const std::vector<BodyState>& truth) {
  for (const LoopRevisit& loop : loops) REQUIRE(full.addRevisit(loop).ok());
  Solved solved;
  REQUIRE(full.solve(solved.report).ok());
  for (std::size_t k = 0; k < full.size(); ++k) {
    solved.states.push_back(full.state(k));
    solved.worlds.push_back(full.world(k));
  }
  solved.error = test::positionError(solved.states, truth);
  return solved;
}

/// Loops to a place that looks exactly like another one more than 2 m away: each new keyframe is said to
/// stand where a far older one stood, and to see what that one saw.
std::vector<LoopRevisit> twinPlaces(const Prepared& run, const std::vector<LoopRevisit>& loops) {
  std::vector<LoopRevisit> wrong;
  for (const LoopRevisit& loop : loops) {
    std::size_t j = 0;
    while (run.causal[j].stamp != loop.new_stamp) ++j;
    std::size_t i = 0;
    const auto position = [&](std::size_t k) { return run.truth[k].T_world_body.translation; };
    while (i < j && (position(i) - position(j)).norm() < 2) ++i;
    if (i == j) continue;
    LoopRevisit twin;
    twin.old_stamp = run.causal[i].stamp;
    twin.new_stamp = loop.new_stamp;
    twin.information = loop.information;
    for (const TrackedFeature& feature : run.flight->frames()[run.keyframes[i]].features) {
      RevisitMatch match;
      match.old_feature.has_track = true;
      match.old_feature.track = feature.id;
      match.new_feature.seen = feature.seen;
      match.new_feature.pixel = feature.pixel;
      twin.matches.push_back(match);
    }
    wrong.push_back(std::move(twin));
  }
  return wrong;
}

}  // namespace

TEST_CASE("Loops make the map better, with wrong matches among them too",
          "[smoother][full_smoother][revisit]") {
  const Prepared& run = firstFlight();
  const std::vector<LoopRevisit> loops = run.loops({});
  REQUIRE(loops.size() > 5);
  const Solved without = solve(run.full[0], {}, run.truth);
  const Solved with = solve(run.full[0], loops, run.truth);
  RevisitSettings wrong_settings;
  wrong_settings.wrong_share = 0.1;
  const Solved wrong = solve(run.full[0], run.loops(wrong_settings), run.truth);
  const Solved elsewhere = solve(run.full[0], twinPlaces(run, loops), run.truth);
  std::printf(
      "revisits: causal %.4f m, full %.4f m, with loops %.4f m (%zu of %zu matches), some wrong "
      "%.4f m (%zu of %zu), all wrong %.4f m (%zu of %zu)\n",
      test::positionError(run.causal, run.truth), without.error, with.error, with.report.matches_used,
      with.report.matches, wrong.error, wrong.report.matches_used, wrong.report.matches, elsewhere.error,
      elsewhere.report.matches_used, elsewhere.report.matches);
  CHECK(with.report.revisits == loops.size());
  CHECK(share(with.report.revisits_used, with.report.revisits) > 0.8);
  CHECK(share(with.report.matches_used, with.report.matches) > 0.95);
  // A swap takes two matches from their landmarks: a fifth of them is wrong.
  CHECK(share(wrong.report.matches_used, wrong.report.matches) < 0.9);
  CHECK(wrong.error < 1.1 * with.error + 2e-4);
  CHECK(share(elsewhere.report.matches_used, elsewhere.report.matches) < 0.02);
  CHECK(elsewhere.error < 1.05 * without.error + 2e-4);
  // One flight's ratio is 0.3 to 0.6.
  double sum_with = with.error, sum_without = without.error;
  for (const std::uint64_t seed : {2U, 3U}) {
    const Prepared other = prepared(28, seed);
    const double error_with = solve(other.full[0], other.loops({}), other.truth).error;
    const double error_without = solve(other.full[0], {}, other.truth).error;
    std::printf("seed %u: full %.4f m, with loops %.4f m\n", static_cast<unsigned>(seed), error_without,
                error_with);
    sum_with += error_with;
    sum_without += error_without;
  }
  CHECK(sum_with < 0.6 * sum_without);
}

TEST_CASE("Loops bring keyframes back from far away", "[smoother][full_smoother][revisit]") {
  const Prepared& run = firstFlight();
  const std::vector<LoopRevisit> loops = run.loops({});
  const Solved straight = solve(run.full[0], loops, run.truth);
  // Poses bent by 8 degrees and 1.5 m over the flight, as a graph of poses would hand them over.
  std::vector<SE3> bent;
  for (std::size_t k = 0; k < run.causal.size(); ++k) {
    const double way = share(k, run.causal.size());
    const SE3 bend(expSo3({0, 0, 0.14 * way}), way * Eigen::Vector3d(1.2, -0.8, 0.3));
    bent.push_back(bend * run.causal[k].T_world_body);
  }
  FullSmoother full = run.full[0];
  REQUIRE(full.setPoses(bent).ok());
  CHECK(full.state(full.size() - 1).v_world_body.norm() ==
        Approx(run.causal.back().v_world_body.norm()).epsilon(1e-9));
  const Solved back = solve(full, loops, run.truth);
  std::printf("revisits from bent poses: %.4f m, from the causal ones %.4f m; %d and %d iterations\n",
              back.error, straight.error, back.report.iterations, straight.report.iterations);
  CHECK(share(back.report.matches_used, back.report.matches) > 0.95);
  CHECK(back.error < straight.error + 5e-4);
}

TEST_CASE("Epochs that loops tie share a world", "[smoother][full_smoother][revisit]") {
  const SE3 T_second_first(expSo3({0, 0, 2.1}), {4, -3, 0.5});
  const Prepared run = prepared(28, 1, 14, T_second_first);
  const std::vector<LoopRevisit> loops = run.loops({});
  const Solved apart = solve(run.full[0], {}, run.truth);
  const Solved together = solve(run.full[0], loops, run.truth);
  std::printf("two epochs: apart %.4f m, tied %.4f m\n", apart.error, together.error);
  CHECK(apart.error > 0.5);
  CHECK(together.error < 0.005);
  CHECK(apart.worlds.front() == 0);
  CHECK(apart.worlds.back() == 1);
  CHECK(together.worlds.back() == 0);
  CHECK(together.states.back().epoch == 1);
  // Loops whose matches are all wrong leave each in a world of its own, and the system solvable.
  std::vector<LoopRevisit> jumbled = loops;
  for (LoopRevisit& loop : jumbled) {
    for (std::size_t m = 1; m < loop.matches.size(); ++m) {
      std::swap(loop.matches[m].old_feature, loop.matches[0].old_feature);
    }
  }
  const Solved untied = solve(run.full[0], jumbled, run.truth);
  // By chance a wrong match agrees now and then.
  CHECK(100 * untied.report.matches_used < untied.report.matches);
  CHECK(untied.worlds.back() == 1);
}

TEST_CASE("Loops with pixels in place of tracks, and loops that cannot be used",
          "[smoother][full_smoother][revisit]") {
  const Prepared run = prepared(24, 2);
  const std::vector<LoopRevisit> tracks = run.loops({});
  REQUIRE(!tracks.empty());
  // The same matches by what the cameras saw.
  std::vector<LoopRevisit> pixels = tracks;
  const auto toPixels = [&](Stamp stamp, RevisitFeature& feature) {
    for (const std::size_t k : run.keyframes) {
      const TrackedFrame& frame = run.flight->frames()[k];
      if (frame.stamp != stamp) continue;
      for (const TrackedFeature& seen : frame.features) {
        if (seen.id == feature.track) feature = {false, 0, seen.seen, seen.pixel};
      }
    }
  };
  for (LoopRevisit& loop : pixels) {
    for (RevisitMatch& match : loop.matches) {
      toPixels(loop.old_stamp, match.old_feature);
      toPixels(loop.new_stamp, match.new_feature);
    }
  }
  const Solved without = solve(run.full[0], {}, run.truth);
  const Solved by_tracks = solve(run.full[0], tracks, run.truth);
  const Solved by_pixels = solve(run.full[0], pixels, run.truth);
  std::printf("loops of %zu: without %.4f m, by tracks %.4f m, by pixels %.4f m\n", tracks.size(),
              without.error, by_tracks.error, by_pixels.error);
  CHECK(by_pixels.report.matches_used > by_tracks.report.matches_used / 2);
  CHECK(by_pixels.error < 0.8 * without.error);

  FullSmoother none(run.flight->rig(), run.flight->noise(), {});
  CHECK(none.addRevisit(tracks[0]).code == StatusCode::kInvalidInput);
  FullSmoother full = run.full[0];
  LoopRevisit bad = tracks[0];
  std::swap(bad.old_stamp, bad.new_stamp);
  CHECK(full.addRevisit(bad).code == StatusCode::kInvalidInput);
  bad = tracks[0];
  bad.new_stamp = bad.new_stamp + Duration::fromMilliseconds(1);
  CHECK(full.addRevisit(bad).code == StatusCode::kInvalidInput);
  bad = tracks[0];
  bad.information(2, 2) = -1;
  CHECK(full.addRevisit(bad).code == StatusCode::kInvalidInput);
  bad = tracks[0];
  bad.T_old_new.translation.y() = std::nan("");
  CHECK(full.addRevisit(bad).code == StatusCode::kInvalidInput);
  CHECK(full.setPoses({}).code == StatusCode::kInvalidInput);
  // Unknown tracks are left out, and with them the loop is nothing.
  bad = tracks[0];
  for (RevisitMatch& match : bad.matches) match.old_feature.track = 1'000'000;
  const Solved unknown = solve(full, {bad}, run.truth);
  CHECK(unknown.report.revisits == 1);
  CHECK(unknown.report.matches == 0);
  CHECK(unknown.error < 1.05 * without.error + 2e-4);
}
