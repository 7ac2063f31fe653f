#pragma once
// A trigger, the edges that were read of it, and a camera on it, with all that goes wrong; exact truth.

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/timesync/trigger_matcher.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet::test {

struct TriggerPattern {
  double period_ms = 50;
  double nominal_off = 0;   ///< of the period, as a share
  double lag = 0.4;         ///< of a period, edge to frame stamp
  double stamp_jitter = 0;  ///< of a period, evenly to both sides, or to one
  bool one_sided = false;
  double arrival = 0.1;       ///< of a period, after the frame's stamp and its edge
  double edge_jitter = 1e-3;  ///< of a period
  double edge_drop = 0, frame_drop = 0, glitch = 0;
  double burst = 0;    ///< odds that a burst of losses of up to 30 begins at a pulse
  double restart = 0;  ///< odds that the stream begins again
  double late = 0;     ///< odds of a frame stamped up to 2 periods late
  double silent = 0;   ///< odds of a frame lost that the driver does not count
  double pause = 0;    ///< odds that the trigger pauses
  std::uint32_t first_sequence = 0;
  int pulses = 400;
};

inline TriggerPattern randomPattern(Random& random) {
  TriggerPattern p;
  p.period_ms = random.uniform(8, 100);
  p.nominal_off = random.uniform(-0.01, 0.01);
  p.stamp_jitter = random.uniform(0, 0.4);
  p.one_sided = random.below(3) == 0;
  p.lag = random.uniform(0, 1.5);
  p.edge_jitter = random.uniform(0, 0.02);
  p.edge_drop = random.uniform(0, 0.3);
  p.frame_drop = random.uniform(0, 0.3);
  p.glitch = random.below(2) == 0 ? random.uniform(0, 0.1) : 0;
  p.burst = random.below(2) == 0 ? 0.01 : 0;
  p.restart = random.below(3) == 0 ? 0.01 : 0;
  p.late = random.below(3) == 0 ? 0.03 : 0;
  p.silent = random.below(3) == 0 ? 0.01 : 0;
  p.pause = random.below(4) == 0 ? 0.005 : 0;
  if (random.below(3) == 0) p.first_sequence = ~std::uint32_t{0} - random.below(300);
  return p;
}

struct TriggerEvent {
  Stamp when;                      ///< order of arrival
  std::optional<FrameMark> frame;  ///< else an edge
  Stamp edge;                      ///< the edge, or the true one of the frame
};

inline std::vector<TriggerEvent> simulateTrigger(const TriggerPattern& p, Random& random) {
  std::vector<TriggerEvent> events;
  const double period = p.period_ms * 1e6;
  double now = 1e12;
  std::uint32_t sequence = p.first_sequence;
  int lost_edges = 0, lost_frames = 0, no_camera = 0;
  const auto stamp = [](double at) { return Stamp{static_cast<std::int64_t>(at)}; };
  for (int i = 0; i < p.pulses; ++i) {
    now += period;
    if (random.uniform() < p.pause) now += period * random.uniform(0.5, 25);
    if (random.uniform() < p.glitch) {
      // A bounce just behind the edge, or noise anywhere.
      const double at = random.below(2) == 0 ? now + random.uniform(0, 0.02) * period
                                             : now + random.uniform(0.02, 0.98) * period;
      events.push_back({stamp(at), std::nullopt, stamp(at)});
    }
    const double edge = now + random.uniform(-1, 1) * p.edge_jitter * period;
    constexpr std::uint32_t kLongestBurst = 30;
    if (random.uniform() < p.burst) lost_edges = 1 + static_cast<int>(random.below(kLongestBurst));
    if (random.uniform() < p.burst) lost_frames = 1 + static_cast<int>(random.below(kLongestBurst));
    if (random.uniform() < p.restart) {
      no_camera = static_cast<int>(random.below(10));
      sequence = 0;
    }
    if (--lost_edges < 0 && random.uniform() >= p.edge_drop) {
      events.push_back({stamp(edge), std::nullopt, stamp(edge)});
    }
    if (--no_camera >= 0 || random.uniform() < p.silent) continue;
    FrameMark frame;
    frame.sequence = sequence++;
    if (--lost_frames >= 0 || random.uniform() < p.frame_drop) continue;
    const double scatter = random.uniform(p.one_sided ? 0 : -1, 1) * p.stamp_jitter;
    const double late = random.uniform() < p.late ? random.uniform(0.3, 2) : 0;
    const double at = edge + (p.lag + scatter + late) * period;
    frame.stamp = stamp(at);
    frame.arrival = stamp(std::max(at, edge) + p.arrival * period);
    events.push_back({frame.arrival, frame, stamp(edge)});
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const TriggerEvent& a, const TriggerEvent& b) { return a.when < b.when; });
  return events;
}

struct TriggerResult {
  std::size_t frames = 0, matched = 0, slips = 0;
  double worst = 0;  ///< periods from the true edge
  TimesyncStatus status;
};

/// `expected`: of a period, what the settings say of the lag.
inline TriggerResult runTrigger(const TriggerPattern& p, double expected, std::uint64_t seed) {
  constexpr double kSlip = 0.5;
  Random random(seed, 5);
  const double period = p.period_ms * 1e6;
  EdgeTrain train({static_cast<std::int64_t>(period * (1 + p.nominal_off))});
  TriggerMatcher matcher(train, Duration{static_cast<std::int64_t>(expected * period)});
  TriggerResult result;
  for (const TriggerEvent& e : simulateTrigger(p, random)) {
    if (!e.frame) {
      train.add(e.edge);
      continue;
    }
    ++result.frames;
    TriggerMatch match;
    if (!matcher.match(*e.frame, match).ok()) continue;
    ++result.matched;
    const double off = std::abs(static_cast<double>((match.edge - e.edge).ns)) / period;
    result.worst = std::max(result.worst, off);
    if (off > kSlip) ++result.slips;
  }
  result.status = matcher.status();
  return result;
}

}  // namespace swiftlet::test
