#pragma once
// Maps a remote clock to the host's CLOCK_MONOTONIC from exchanges in both directions (MAVLink TIMESYNC,
// PTP-like).
//
// Input: exchanges (own send, remote stamp, own receive). With x the remote stamp and D(x) = host - remote:
//   receive - x = D + back + jitter,   x - send = -D + forth + jitter.
// These are two one-way links, each with its lower envelope. D is half the difference of the envelopes; its
// error is half the asymmetry of the constant delays, (back - forth) / 2. Half the sum is half the smallest
// round trip, which bounds the error for any asymmetry.
//
// The usual filter keeps only exchanges with a short round trip. Here the smallest delays in the two
// directions need not belong to the same exchange, so a slow exchange with one quick half still helps.
//
// When the remote clock steps, one direction seems faster than possible and the other slower. If one is too
// fast by up to 5 ms, its envelope restarts at once; the other restarts when no point comes near its line any
// more (LowerEnvelope::raised). A larger step, or a remote stamp that goes back, must be confirmed by two
// more exchanges that agree. Errors: kInvalidInput. Cost: two LowerEnvelopes; memory 5 KiB. Source: V.
// Paxson, "On calibrating measurements of packet transit times", SIGMETRICS 1998; D. L. Mills, RFC 5905
// section 10 (clock filter, the bound).

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
  Status add(const ClockExchange& exchange);
  /// Host stamp of a remote stamp; not made rising (see RisingStamps). Empty before the first exchange.
  [[nodiscard]] std::optional<Stamp> toHost(Stamp remote) const;

  [[nodiscard]] LockState lock() const;
  /// Whether this map is better than arrivals alone: if locked, or, before its first lock, after five
  /// exchanges (half a second of TIMESYNC), when the smallest delays are known to some tenths of a
  /// millisecond.
  [[nodiscard]] bool usable() const;
  /// Residuals: round trip above the smallest one.
  [[nodiscard]] TimesyncStatus status() const;

 private:
  Status suspect(const ClockExchange& exchange);
  void lower(LowerEnvelope& side, double above, double tolerance);
  void watchForRise(LowerEnvelope& side);
  void learn(const ClockExchange& exchange);
  [[nodiscard]] double uncertainty(Stamp remote) const;
  /// Halves are taken before subtracting: twice D would overflow for far stamps.
  [[nodiscard]] std::int64_t difference(Stamp remote) const;

  LowerEnvelope back_;   ///< of receive - remote
  LowerEnvelope forth_;  ///< of remote - send
  DelayHistogram round_trips_;
  Stamp newest_;
  int suspects_ = 0;
  Stamp suspect_newest_;
  std::int64_t suspect_low_ = 0, suspect_high_ = 0;  ///< bounds of D from all suspects so far
  std::uint64_t samples_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
  bool was_locked_ = false;
};

}  // namespace swiftlet
