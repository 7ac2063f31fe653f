// The effort governor against simulated stages: it stays within the budget, does not flutter, forgives a
// hiccup and gives everything back.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "estimator/core/random.hpp"
#include "firmware_host/realtime/effort_governor.hpp"

namespace swiftlet {
namespace {

constexpr GovernorSettings kSettings{.step_budget = 0.012, .age_budget = 0.05, .good_steps = 10};
constexpr double kPeriod = 0.05;  // s between frames

constexpr Effort kFull{.iterations = 2, .features = 300, .keyframes = 12};

/// s; as measured on the recorded logs: about 4 ms a frame and 7 ms a keyframe, a quarter of it fixed.
double trackTime(const Effort& effort, int frame) {
  const double share = effort.features / 300.0;
  return frame % 4 == 0 ? 0.0015 + 0.0055 * share : 0.001 + 0.003 * share;
}

double smoothTime(const Effort& effort, int) {
  return 0.0005 +
         0.0024 * effort.iterations / 2.0 * effort.features / 300.0 * (0.3 + 0.7 * effort.keyframes / 12.0);
}

struct Run {
  std::vector<int> levels;    // given to each frame
  std::vector<double> times;  // that it took
  std::vector<EffortChange> changes;
};

/// Frames come every period into a queue of four; the stage works one after the other.
Run runStage(EffortGovernor& governor, const std::function<double(const Effort&, int)>& cost,
             const std::function<double(int)>& slowness, int frames) {
  constexpr int kQueue = 4;
  Run run;
  double now = 0;
  int next = 0;
  for (int frame = 0; frame < frames; ++frame) {
    next = std::max(next, static_cast<int>(now / kPeriod) - kQueue);  // the oldest were dropped
    const double arrival = next * kPeriod;
    now = std::max(now, arrival);
    const double age = now - arrival;
    const double wall = cost(governor.effort(), frame) * slowness(frame);
    run.levels.push_back(governor.level());
    run.times.push_back(wall);
    now += wall;
    const int waiting = std::clamp(static_cast<int>(std::floor(now / kPeriod)) - next, 0, kQueue);
    if (const auto change = governor.update({wall, waiting, age})) run.changes.push_back(*change);
    ++next;
  }
  return run;
}

int reversals(const Run& run) {
  int count = 0;
  for (std::size_t i = 1; i < run.changes.size(); ++i) {
    const bool down = run.changes[i].level > run.changes[i].from;
    const bool down_before = run.changes[i - 1].level > run.changes[i - 1].from;
    count += down != down_before ? 1 : 0;
  }
  return count;
}

TEST_CASE("ladders: full effort first, each level less in one thing, never below the least") {
  const Effort& full = kFull;
  const EffortLadder tracker = trackerLadder(full);
  REQUIRE(tracker.size() > 4);
  CHECK(tracker[0] == full);
  CHECK(tracker.back().features == 40);
  for (std::size_t i = 1; i < tracker.size(); ++i) {
    CHECK(tracker[i].features < tracker[i - 1].features);
    CHECK(tracker[i].iterations == full.iterations);
    CHECK(tracker[i].keyframes == full.keyframes);
  }
  const EffortLadder smoother = smootherLadder(full);
  REQUIRE(smoother.size() > 5);
  CHECK(smoother[1] == Effort{.iterations = 1, .features = 300, .keyframes = 12});
  CHECK(smoother[2] == Effort{.iterations = 1, .features = 225, .keyframes = 12});
  CHECK(smoother.back().keyframes == 5);
  CHECK(smoother.back().features > 40);
  for (const Effort& extreme : {Effort{1, 1, 1}, Effort{0, 0, 0}, Effort{-3, -5, -1}, Effort{20, 400, 24},
                                Effort{1, 41, 6}, Effort{1000000, 1000000, 1000000}}) {
    for (const EffortLadder& ladder : {trackerLadder(extreme), smootherLadder(extreme)}) {
      REQUIRE(!ladder.empty());
      for (std::size_t i = 0; i < ladder.size(); ++i) {
        CHECK(ladder[i].features >= 1);
        CHECK(ladder[i].iterations >= 1);
        CHECK(ladder[i].keyframes >= 1);
        if (i == 0) continue;
        CHECK(ladder[i] != ladder[i - 1]);
        CHECK(ladder[i].features <= ladder[i - 1].features);
        CHECK(ladder[i].iterations <= ladder[i - 1].iterations);
        CHECK(ladder[i].keyframes <= ladder[i - 1].keyframes);
      }
    }
  }
}

TEST_CASE("within the budget nothing is taken away") {
  EffortGovernor tracker(trackerLadder(kFull), kSettings);
  CHECK(runStage(
            tracker, trackTime, [](int) { return 1.0; }, 2000)
            .changes.empty());
  EffortGovernor smoother(smootherLadder(kFull), kSettings);
  CHECK(runStage(
            smoother, smoothTime, [](int) { return 1.0; }, 2000)
            .changes.empty());
}

TEST_CASE("a stage made four times slower is within its budget after ten frames, and recovers fully") {
  constexpr int kFrom = 100;
  constexpr int kUntil = 600;
  constexpr int kFrames = 900;
  constexpr int kConverged = 10;
  const auto slowness = [](int frame) { return frame >= kFrom && frame < kUntil ? 4.0 : 1.0; };
  const auto check = [&](const EffortLadder& ladder, double budget, const auto& cost) {
    GovernorSettings settings = kSettings;
    settings.step_budget = budget;
    EffortGovernor governor(ladder, settings);
    const Run run = runStage(governor, cost, slowness, kFrames);
    INFO("budget " << budget);
    int beyond = 0;
    for (int i = kFrom + kConverged; i < kUntil; ++i) {
      beyond += run.times[static_cast<std::size_t>(i)] > budget ? 1 : 0;
    }
    // What is beyond it then are the steps up that were tried in vain, of at most two steps each.
    CHECK(beyond <= (kUntil - kFrom) / 40);
    CHECK(run.levels[kFrom] == 0);
    CHECK(run.levels[kFrom + kConverged] > 0);
    for (int i = 0; i < kFrom; ++i) CHECK(run.levels[static_cast<std::size_t>(i)] == 0);
    CHECK(governor.level() == 0);
    CHECK(!governor.degraded());
    // Fully recovered 10 steps a level after the end at the latest, the window's 8 before each on top.
    const auto recovered = static_cast<std::size_t>(kUntil) + 18 * ladder.size();
    REQUIRE(recovered < run.levels.size());
    CHECK(run.levels[recovered] == 0);
    CHECK(reversals(run) <= 2 * (kUntil - kFrom) / settings.good_steps / 3);
    REQUIRE(!run.changes.empty());
    CHECK(run.changes.front().why != EffortReason::kRecovered);
    CHECK(run.changes.back().why == EffortReason::kRecovered);
  };
  check(trackerLadder(kFull), 0.012, trackTime);
  check(trackerLadder(kFull), 0.016, trackTime);
  check(smootherLadder(kFull), 0.004, smoothTime);
  check(smootherLadder(kFull), 0.008, smoothTime);
}

TEST_CASE("a load that grows is met before a step takes its whole budget") {
  EffortGovernor governor(trackerLadder(kFull), kSettings);
  // Keyframes of 7 ms reach the budget of 12 ms at a slowness of 1.7.
  const Run run = runStage(
      governor, trackTime, [](int frame) { return 1 + frame / 1000.0; }, 1200);
  // Beyond it are only the steps up that were tried in vain, one keyframe each.
  const auto beyond = std::count_if(run.times.begin(), run.times.end(),
                                    [](double time) { return time > kSettings.step_budget; });
  CHECK(beyond <= 3);
  CHECK(*std::max_element(run.times.begin(), run.times.end()) <= 1.2 * kSettings.step_budget);
  CHECK(governor.level() > 0);
  REQUIRE(!run.changes.empty());
  CHECK(run.changes.front().why == EffortReason::kPredictedMiss);
  CHECK(run.changes.front().predicted <= kSettings.step_budget);
}

TEST_CASE("one step that the system made slow costs nothing, or half a second when frames piled up") {
  EffortGovernor governor(trackerLadder(kFull), kSettings);
  const auto hiccup = [](double wall) {
    return [wall](int frame) { return frame == 100 ? wall / trackTime(kFull, 100) : 1.0; };
  };
  CHECK(runStage(governor, trackTime, hiccup(0.045), 300).changes.empty());
  // 120 ms at 20 Hz leave two frames waiting: that acts at once, by one level, and is given back soon.
  const Run run = runStage(governor, trackTime, hiccup(0.12), 300);
  REQUIRE(run.changes.size() == 2);
  CHECK(run.changes[0].why == EffortReason::kBacklog);
  CHECK(run.changes[0].level == 1);
  CHECK(run.levels[101] == 1);
  CHECK(run.levels[101 + 2 * kSettings.good_steps] == 0);
}

TEST_CASE("frames that come late act after three on end, and not through one") {
  const auto levelsAfter = [](int late_steps) {
    EffortGovernor governor(trackerLadder(kFull), kSettings);
    for (int i = 0; i < 20; ++i) governor.update({0.004, 0, 0.001});
    for (int i = 0; i < late_steps; ++i) governor.update({0.004, 0, 0.048});
    return governor.level();
  };
  CHECK(levelsAfter(1) == 0);
  CHECK(levelsAfter(2) == 0);
  CHECK(levelsAfter(3) == 1);
}

TEST_CASE("between a level that is too slow and one that is not, changes are rare") {
  // Level 0 takes 1.2 budgets, level 1 takes half of one.
  EffortGovernor governor(trackerLadder(kFull), kSettings);
  Run run;
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) {
    const double wall = kSettings.step_budget * (governor.level() == 0 ? 1.2 : 0.5);
    if (const auto change = governor.update({wall, 0, 0})) run.changes.push_back(*change);
  }
  // A step up each 80 steps, and its step down.
  CHECK(run.changes.size() <= 2 * kSteps / 80 + 10);
  CHECK(run.changes.size() >= 10);  // but it does try
}

TEST_CASE("whatever comes, levels stay on the ladder and changes are told as they are") {
  Random random(5);
  const double odd[] = {
      0,    -1,   std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
      1e-9, 1e30, -std::numeric_limits<double>::infinity()};
  int up = 0;
  for (int pattern = 0; pattern < 20; ++pattern) {
    const EffortLadder ladder = pattern % 2 == 0 ? trackerLadder(kFull) : smootherLadder(kFull);
    EffortGovernor governor(ladder, kSettings);
    EffortGovernor twin(ladder, kSettings);
    double slowness = 1;
    int steps_since_change = 1000;
    bool calm = false;
    for (int i = 0; i < 3000; ++i) {
      if (random.uniform() < 0.02) slowness = 0.3 + 8 * random.uniform();
      if (random.uniform() < 0.01) calm = !calm;
      StepTiming timing{slowness * trackTime(governor.effort(), i),
                        calm ? 0 : static_cast<int>(random.below(4)),
                        (calm ? 0.02 : 0.06) * random.uniform()};
      if (random.uniform() < 0.01) timing.wall = odd[random.below(7)];
      if (random.uniform() < 0.01) timing.age = odd[random.below(7)];
      const int before = governor.level();
      const auto change = governor.update(timing);
      const auto same = twin.update(timing);
      ++steps_since_change;
      REQUIRE(change.has_value() == same.has_value());
      REQUIRE(governor.effort() == twin.effort());
      REQUIRE(governor.level() >= 0);
      REQUIRE(governor.level() <= governor.lowestLevel());
      REQUIRE(governor.effort().features >= 40);
      REQUIRE(governor.effort() == ladder[static_cast<std::size_t>(governor.level())]);
      REQUIRE(change.has_value() == (governor.level() != before));
      if (!change) continue;
      REQUIRE(change->from == before);
      REQUIRE(change->level == governor.level());
      REQUIRE(change->effort == governor.effort());
      const bool down = change->level > change->from;
      REQUIRE(down == (change->why != EffortReason::kRecovered));
      REQUIRE(change->level - change->from <= 2);
      REQUIRE(change->level - change->from >= -1);
      if (!down) {
        ++up;
        REQUIRE(steps_since_change >= kSettings.good_steps);
      }
      steps_since_change = 0;
    }
    // Then peace: everything is given back.
    for (int i = 0; i < 80 * static_cast<int>(ladder.size()); ++i) governor.update({0.001, 0, 0});
    CHECK(governor.level() == 0);
  }
  CHECK(up > 100);
}

}  // namespace
}  // namespace swiftlet
