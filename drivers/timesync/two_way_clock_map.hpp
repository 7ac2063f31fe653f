#pragma once
// From a remote clock to the host's CLOCK_MONOTONIC, where both sides speak (MAVLink TIMESYNC, PTP-like).
//
// In: exchanges (own send, remote stamp, own receive). With x the remote stamp and D(x) = host - remote:
//   receive - x = D + back + jitter,   x - send = -D + forth + jitter,
// two one-way links, each with its lower envelope. D is half their difference, wrong by half the asymmetry
// (back - forth) / 2 of the constant delays; half their sum is the half of the smallest round trip, which
// bounds the error whatever the asymmetry is.
//
// That is the usual filter of minimum round trips taken further: the smallest delays forth and back need not
// come in the same exchange, so a slow exchange whose one half was quick still counts. Exchanges of twice the
// smallest round trip and more are told (`slow`), as they show a loaded link.
//
// A remote clock that steps breaks causality on one side and delays the other. A violation of up to 5 ms
// starts that side anew and the other follows when nothing comes near its line any more
// (LowerEnvelope::raised); a greater one, or a remote stamp that goes back, must be confirmed by two more
// exchanges that agree. Errors: kInvalidInput. Cost: as two LowerEnvelopes, 5 KiB. Source: V. Paxson, "On
// calibrating measurements of packet transit times", SIGMETRICS 1998; D. L. Mills, RFC 5905 section 10 (clock
// filter, the bound).

#include <cstdint>
#include <optional>

#include "drivers/timesync/delay_histogram.hpp"
#include "drivers/timesync/lower_envelope.hpp"
#include "drivers/timesync/timesync_status.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

struct ClockExchange {
  Stamp send;     ///< own clock, when the request left
  Stamp remote;   ///< the answer's stamp on the other clock
  Stamp receive;  ///< own clock, when the answer came
};

class TwoWayClockMap {
 public:
  /// `max_skew_ppm`: as in ClockMapSettings.
  explicit TwoWayClockMap(double max_skew_ppm = 150);

  Status add(const ClockExchange& exchange);
  /// Host stamp of a remote stamp; not made monotonic (RisingStamps does that). Empty before the first
  /// exchange.
  [[nodiscard]] std::optional<Stamp> toHost(Stamp remote) const;

  [[nodiscard]] LockState lock() const;
  /// Better than arrivals alone: locked, or, before it was so for the first time, after half a second at
  /// TIMESYNC's rate, when the smallest delays to and fro are known to some tenths of a millisecond.
  [[nodiscard]] bool usable() const;
  /// Residuals are of the round trip above the smallest.
  [[nodiscard]] TimesyncStatus status() const;
  [[nodiscard]] std::uint64_t slow() const { return slow_; }

 private:
  Status suspect(const ClockExchange& exchange);
  void lower(LowerEnvelope& side, double above, double tolerance);
  void watchForRise(LowerEnvelope& side);
  void learn(const ClockExchange& exchange);
  [[nodiscard]] double uncertainty(Stamp remote) const;
  /// Twice D and twice the error bound would overflow for far stamps: the halves are taken first.
  [[nodiscard]] std::int64_t difference(Stamp remote) const;

  LowerEnvelope back_;   ///< of receive - remote
  LowerEnvelope forth_;  ///< of remote - send
  DelayHistogram round_trips_;
  Stamp newest_;
  int suspects_ = 0;
  Stamp suspect_newest_;
  std::int64_t suspect_low_ = 0, suspect_high_ = 0;  ///< D lies between, by all suspects so far
  std::uint64_t samples_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t slow_ = 0;
  bool was_locked_ = false;
};

}  // namespace swiftlet
