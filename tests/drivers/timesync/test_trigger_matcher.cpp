#include <catch2/catch.hpp>

#include <array>
#include <cstdio>
#include <limits>

#include "drivers/timesync/stamp_limit.hpp"
#include "tests/drivers/timesync/simulated_trigger.hpp"
#include "tests/drivers/timesync/units.hpp"

namespace swiftlet {
namespace {

using test::kMs;
using test::TriggerPattern;
using test::TriggerResult;

TEST_CASE("Association never slips in 10 000 random patterns", "[timesync][trigger]") {
  TriggerResult all;
  for (std::uint64_t seed = 0; seed < 10'000; ++seed) {
    Random random(seed, 9);
    const TriggerPattern p = test::randomPattern(random);
    const double mean = p.lag + (p.one_sided ? p.stamp_jitter / 2 : 0);
    const TriggerResult one = test::runTrigger(p, mean + random.uniform(-0.1, 0.1), seed);
    if (one.slips > 0) UNSCOPED_INFO("seed " << seed << ": " << one.slips << " slips");
    all.frames += one.frames;
    all.matched += one.matched;
    all.slips += one.slips;
  }
  CHECK(all.slips == 0);
  CHECK(all.frames > 3'000'000);
  // Bursts, restarts, pauses and the 32 first frames of 400 cost their frames, not more.
  CHECK(static_cast<double>(all.matched) > 0.6 * static_cast<double>(all.frames));
  std::printf("trigger: %zu frames, %.1f %% with their edge, %zu slips\n", all.frames,
              100.0 * static_cast<double>(all.matched) / static_cast<double>(all.frames), all.slips);
}

TEST_CASE("Losses alone cost no more than the locking", "[timesync][trigger]") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    TriggerPattern p;
    p.edge_drop = 0.1;
    p.frame_drop = 0.1;
    p.glitch = 0.05;
    p.stamp_jitter = 0.3;
    p.first_sequence = ~std::uint32_t{0} - 100;
    p.pulses = 2000;
    const TriggerResult r = test::runTrigger(p, 0.4, seed);
    CHECK(r.slips == 0);
    CHECK(r.matched + 31 >= r.frames - r.frames / 20);
    CHECK(r.status.lock == LockState::kLocked);
    CHECK(r.status.resets == 0);
    CHECK(static_cast<double>(r.status.missed_edges) == Approx(200).margin(80));
    CHECK(r.status.offset.seconds() == Approx(0.02).margin(0.004));
  }
}

TEST_CASE("A lag between two edges is said, not guessed", "[timesync][trigger]") {
  for (const double lag : {0.45, -0.45, 0.5}) {
    TriggerPattern p;
    p.lag = 0.5 + lag;
    const TriggerResult r = test::runTrigger(p, 0.5, 1);
    CHECK(r.matched == 0);
    CHECK(r.status.lock != LockState::kLocked);
  }
}

TEST_CASE("No edge is later than the arrival of its frame", "[timesync][trigger]") {
  // Stamps are 40 of 50 ms late, but are expected at the edge: the next edge, 10 ms ahead, is nearer.
  TriggerPattern p;
  p.lag = 0.8;
  p.arrival = 0;
  const TriggerResult r = test::runTrigger(p, 0, 1);
  CHECK(r.slips == 0);
  CHECK(r.matched == 0);
  CHECK(r.status.lock != LockState::kLocked);
}

TEST_CASE("A camera that runs freely is not held for a triggered one", "[timesync][trigger]") {
  EdgeTrain train({50 * kMs});
  TriggerMatcher matcher(train, Duration{10 * kMs});
  std::size_t matched = 0;
  for (int i = 0; i < 2000; ++i) {
    train.add({i * 50 * kMs});
    TriggerMatch match;
    const Stamp stamp = {i * 52 * kMs + 10 * kMs};
    if (matcher.match({stamp, static_cast<std::uint32_t>(i), stamp + Duration{kMs}}, match).ok()) ++matched;
  }
  CHECK(matched < 700);
  CHECK(matcher.status().resets + matcher.status().refused > 20);
}

/// A train and a camera of which each frame takes its edge plus `lag`.
struct Rig {
  explicit Rig(Duration expected) : matcher(train, expected) {}
  Status frame(int pulse, std::uint32_t sequence, std::int64_t lag) {
    const Stamp stamp = {(1000 + pulse) * 50 * kMs + lag};
    return matcher.match({stamp, sequence, stamp + Duration{kMs}}, match);
  }
  void edge(int pulse) { train.add({(1000 + pulse) * 50 * kMs}); }
  EdgeTrain train{{50 * kMs}};
  TriggerMatcher matcher;
  TriggerMatch match;
};

TEST_CASE("The wrap of the sequence is no restart, a restart is locked again in eight frames",
          "[timesync][trigger]") {
  Rig rig(Duration{10 * kMs});
  std::uint32_t sequence = ~std::uint32_t{0} - 50;
  for (int i = 0; i < 200; ++i, ++sequence) {
    rig.edge(i);
    CHECK(rig.frame(i, sequence, 10 * kMs).ok() == (i >= 31));
  }
  CHECK(rig.matcher.status().resets == 0);
  for (int i = 200; i < 220; ++i) {
    rig.edge(i);
    CHECK(rig.frame(i, static_cast<std::uint32_t>(i - 200), 10 * kMs).ok() == (i >= 207));
  }
  CHECK(rig.matcher.status().resets == 1);
  CHECK(rig.match.pulse == 219);
}

TEST_CASE("A missed edge is bridged, and said", "[timesync][trigger]") {
  Rig rig(Duration{10 * kMs});
  for (int i = 0; i < 100; ++i) {
    if (i < 60 || i > 62) rig.edge(i);
    const bool ok = rig.frame(i, static_cast<std::uint32_t>(i), 10 * kMs).ok();
    if (i < 31) continue;
    CHECK(ok);
    CHECK(rig.match.measured == (i < 60 || i > 62));
    CHECK(std::abs(rig.match.edge.ns - (1000 + i) * 50 * kMs) < kMs / 100);
  }
  CHECK(rig.train.missed() == 3);
}

TEST_CASE("Both cameras of a pair count the same pulses", "[timesync][trigger]") {
  EdgeTrain train({50 * kMs});
  TriggerMatcher left(train, Duration{10 * kMs}), right(train, Duration{25 * kMs});
  for (int i = 0; i < 100; ++i) {
    const Stamp edge = {i * 50 * kMs};
    train.add(edge);
    TriggerMatch l, r;
    const Stamp arrival = edge + Duration{30 * kMs};
    const bool has_left =
        left.match({edge + Duration{10 * kMs}, static_cast<std::uint32_t>(i), arrival}, l).ok();
    if (i < 5) continue;  // the right one came up later, and counts from 0
    const auto sequence = static_cast<std::uint32_t>(i - 5);
    const bool has_right = right.match({edge + Duration{25 * kMs}, sequence, arrival}, r).ok();
    if (has_left && has_right) CHECK(l.pulse == r.pulse);
    if (i > 40) CHECK((has_left && has_right));
  }
}

TEST_CASE("Edges: numbered events tell a pulse that was not there from one that was missed",
          "[timesync][trigger]") {
  EdgeTrain train({50 * kMs});
  std::uint32_t event = 7;
  for (int i = 0; i < 50; ++i) {
    if (i == 20) continue;  // no pulse
    if (i == 30) {
      ++event;  // lost in the kernel
      continue;
    }
    train.add({i * 50 * kMs}, event++);
  }
  CHECK(train.missed() == 1);
  CHECK(train.epoch() == 0);
  for (int i = 0; i < 4; ++i) train.add({(60 + i) * 50 * kMs + 20 * kMs});
  CHECK(train.epoch() == 1);
  CHECK(train.nearest({63 * 50 * kMs + 21 * kMs}) == 0);
  train.add({1000 * 50 * kMs});
  CHECK(train.epoch() == 2);
}

TEST_CASE("Trigger takes any stamps without overflow", "[timesync][trigger]") {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  const std::array<std::int64_t, 8> odd = {0,         1, kMost, kLeast, kStampLimit - 1, 1 - kStampLimit,
                                           1LL << 53, -1};
  std::size_t matched = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    Random random(seed);
    EdgeTrain train({odd[random.below(odd.size())] / 1000 + (seed % 2 == 0 ? 10 * kMs : 0)});
    TriggerMatcher matcher(train, Duration{odd[random.below(odd.size())] % (100 * kMs)});
    std::int64_t t = 0;
    std::uint32_t sequence = random.next();
    for (int i = 0; i < 500; ++i) {
      if (random.below(100) == 0) t = odd[random.below(odd.size())];
      if (random.below(100) == 0) sequence = random.next();
      if (withinLimit({t})) t += train.period().ns % (1LL << 50U);
      train.add({t});
      TriggerMatch match;
      if (matcher.match({{t}, sequence++, {t}}, match).ok()) ++matched;
      (void)train.at(odd[random.below(odd.size())] / 4);
      (void)train.nearest({odd[random.below(odd.size())]});
      (void)matcher.status();
    }
  }
  CHECK(matched > 1000);
}

}  // namespace
}  // namespace swiftlet
