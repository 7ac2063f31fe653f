#pragma once
// A sensor's clock and the link it speaks over, with exact truth: skew, wander, steps, delays, losses.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet::test {

enum class Jitter { kNone, kUniform, kExponential };

struct LinkSettings {
  double rate = 200;  ///< [Hz]
  double seconds = 60;
  double skew_ppm = 100;
  double wander_ppm = 0;       ///< amplitude of a sine on the rate
  double wander_period = 240;  ///< [s]
  double warm_ppm_per_s = 0;   ///< the rate's change, for the first 100 s
  double slew_ppm = 0;         ///< the rate's change from slew_at [s] for slew_for [s]
  double slew_at = 0, slew_for = 0;
  Jitter jitter = Jitter::kUniform;
  double jitter_ms = 5;  ///< largest (uniform) or mean (exponential)
  double constant_ms = 3;
  double lost = 0.05;
  bool in_order = true;        ///< a late message holds up those behind it
  double step_every = 0;       ///< [s] between steps of the clock; 0: none
  double largest_step = 3600;  ///< [s], both signs, evenly in its logarithm from 0.3 ms; 0: back to zero
  double outage_at = 0, outage_for = 0;  ///< [s]
};

struct Sample {
  Stamp device, arrival, truth;  ///< truth: host stamp at which the device stamped
  double since_step = 0;         ///< [s] since the start or the clock's last step
};

inline double jitterMs(const LinkSettings& link, Random& random) {
  if (link.jitter == Jitter::kNone) return 0;
  if (link.jitter == Jitter::kUniform) return random.uniform(0, link.jitter_ms);
  return -link.jitter_ms * std::log((random.next() + 1.0) * 0x1p-32);
}

/// Device nanoseconds at host second t, before any step: the integral of the rate.
inline double deviceSeconds(const LinkSettings& link, double t) {
  const double turn = 2 * std::numbers::pi / link.wander_period;
  const double warm = std::min(t, 100.0);
  const double slewed = std::clamp(t - link.slew_at, 0.0, link.slew_for);
  return t - 1e-6 * (link.skew_ppm * t + link.wander_ppm * (1 - std::cos(turn * t)) / turn +
                     link.warm_ppm_per_s * (warm * warm / 2 + warm * (t - warm)) + link.slew_ppm * slewed);
}

inline std::vector<Sample> simulateLink(const LinkSettings& link, std::uint64_t seed) {
  Random random(seed);
  std::vector<Sample> samples;
  constexpr std::int64_t kHostStart = 5'000'000'000'000;
  double device_offset = random.uniform(0, 1e6);
  double begun = 0;
  std::int64_t arrived = 0;
  for (std::int64_t i = 0; static_cast<double>(i) < link.seconds * link.rate; ++i) {
    const double t = static_cast<double>(i) / link.rate;
    if (link.step_every > 0 && t - begun >= link.step_every) {
      begun = t;
      if (link.largest_step == 0) {
        device_offset = -deviceSeconds(link, t);
      } else {
        const double size = 3e-4 * std::pow(link.largest_step / 3e-4, random.uniform());
        device_offset += random.uniform() < 0.5 ? size : -size;
      }
    }
    const double delay = (link.constant_ms + jitterMs(link, random)) * 1e6;
    const bool silent = t >= link.outage_at && t < link.outage_at + link.outage_for;
    if (silent || random.uniform() < link.lost) continue;
    Sample s;
    s.truth = {kHostStart + Duration::fromSeconds(t).ns};
    s.device = {Duration::fromSeconds(deviceSeconds(link, t)).ns + Duration::fromSeconds(device_offset).ns};
    s.arrival = s.truth + Duration{static_cast<std::int64_t>(delay)};
    if (link.in_order) s.arrival.ns = std::max(s.arrival.ns, arrived);
    arrived = s.arrival.ns;
    s.since_step = t - begun;
    samples.push_back(s);
  }
  return samples;
}

struct Exchange {
  Stamp send, remote, receive, truth;  ///< truth: host stamp of the remote one
  double since_step = 0;
};

/// The same link, asked: the way there has its own constant delay and the same jitter.
inline std::vector<Exchange> simulateExchanges(const LinkSettings& link, double forth_ms,
                                               std::uint64_t seed) {
  constexpr std::uint64_t kOther = 77;
  Random random(seed, kOther);
  std::vector<Exchange> exchanges;
  for (const Sample& s : simulateLink(link, seed)) {
    const Duration forth = Duration::fromSeconds((forth_ms + jitterMs(link, random)) * 1e-3);
    exchanges.push_back({s.truth - forth, s.device, s.arrival, s.truth, s.since_step});
  }
  return exchanges;
}

}  // namespace swiftlet::test
