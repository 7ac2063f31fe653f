#pragma once
// Runs simulated links through ClockMap and TwoWayClockMap and gives the errors beyond
// the constant delay, two-way beyond half the asymmetry.

#include <vector>

#include "drivers/timesync/clock_map.hpp"
#include "drivers/timesync/two_way_clock_map.hpp"
#include "tests/drivers/timesync/simulated_clock.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet::test {

/// [ms] by which the estimated bound may be short of the true one: it is half a smallest round trip that was
/// estimated, too.
inline constexpr double kBoundSlack = 0.1;

struct ClockErrors {
  std::vector<double> settled;  ///< |error| [ms] from 10 s after the start and after each step
  std::vector<double> early;    ///< from 1 s to 10 s
  std::size_t samples = 0;
  std::size_t refused = 0;
  std::size_t not_rising = 0;    ///< stamps at or before the one before
  double locked_share = 0;       ///< of the settled samples
  std::size_t beyond_bound = 0;  ///< settled stamps farther off than the bound that was given for them
  TimesyncStatus status;
};

inline void runClockMap(const LinkSettings& link, std::uint64_t seed, ClockErrors& errors) {
  constexpr double kSettled = 10;
  ClockMap map;
  Stamp last{std::numeric_limits<std::int64_t>::min()};
  double locked = 0, settled = 0;
  for (const Sample& s : simulateLink(link, seed)) {
    ++errors.samples;
    Stamp host;
    if (!map.add(s.device, s.arrival, host).ok()) {
      ++errors.refused;
      continue;
    }
    if (host <= last) ++errors.not_rising;
    last = host;
    const double error = std::abs(static_cast<double>((host - s.truth).ns) * 1e-6 - link.constant_ms);
    if (s.since_step < 1) continue;
    (s.since_step < kSettled ? errors.early : errors.settled).push_back(error);
    if (s.since_step < kSettled) continue;
    ++settled;
    if (map.lock() == LockState::kLocked) ++locked;
  }
  errors.status = map.status();
  errors.locked_share = settled > 0 ? locked / settled : 0;
}

inline void runTwoWay(const LinkSettings& link, double forth_ms, std::uint64_t seed, ClockErrors& errors) {
  constexpr double kSettled = 10;
  TwoWayClockMap map;
  double locked = 0, settled = 0;
  const double asymmetry = (link.constant_ms - forth_ms) / 2;
  for (const Exchange& e : simulateExchanges(link, forth_ms, seed)) {
    ++errors.samples;
    if (!map.add({e.send, e.remote, e.receive}).ok()) {
      ++errors.refused;
      continue;
    }
    if (e.since_step < 1) continue;
    const double signed_error = static_cast<double>((*map.toHost(e.remote) - e.truth).ns) * 1e-6;
    const double error = std::abs(signed_error - asymmetry);
    (e.since_step < kSettled ? errors.early : errors.settled).push_back(error);
    if (e.since_step < kSettled) continue;
    ++settled;
    if (map.lock() == LockState::kLocked) ++locked;
    if (std::abs(signed_error) > map.status().error_bound.seconds() * 1e3 + kBoundSlack)
      ++errors.beyond_bound;
  }
  errors.status = map.status();
  errors.locked_share = settled > 0 ? locked / settled : 0;
}

/// What two-way maps usually do, to compare: the offset of the newest exchange with a round trip below twice
/// the smallest of the last 32 s, held until the next.
inline std::vector<double> runRoundTripFilter(const LinkSettings& link, double forth_ms, std::uint64_t seed) {
  std::vector<double> errors;
  const auto exchanges = simulateExchanges(link, forth_ms, seed);
  std::int64_t offset = 0;
  for (std::size_t i = 0; i < exchanges.size(); ++i) {
    const Exchange& e = exchanges[i];
    std::int64_t smallest = (e.receive - e.send).ns;
    constexpr std::int64_t kWindow = 32'000'000'000;
    for (std::size_t k = i; k-- > 0 && (e.receive - exchanges[k].receive).ns < kWindow;) {
      smallest = std::min(smallest, (exchanges[k].receive - exchanges[k].send).ns);
    }
    if ((e.receive - e.send).ns < 2 * smallest || i == 0) {
      offset = e.receive.ns - (e.receive - e.send).ns / 2 - e.remote.ns;
    }
    if (e.since_step < 10) continue;
    const double error = static_cast<double>(e.remote.ns + offset - e.truth.ns) * 1e-6;
    errors.push_back(std::abs(error - (link.constant_ms - forth_ms) / 2));
  }
  return errors;
}

}  // namespace swiftlet::test
