#pragma once
// Maps a sensor's clock to the host's CLOCK_MONOTONIC from one-way messages.
//
// Input: pairs (device stamp x, arrival a). Output, without waiting: the host stamp of x. The model is a - x
// = offset(x) + constant delay + jitter with jitter >= 0, so offset + constant delay is the lower envelope of
// a - x (lower_envelope.hpp). The constant delay is not observable from one-way messages: set it if it is
// known.
//
// - Returned stamps rise strictly (rising_stamps.hpp). They are not later than the arrival, unless that is
//   needed to keep them rising.
// - Steps of the device's clock. A stamp is refused if it repeats or goes back, if it is more than 5 ms too
//   early for the smallest delay, or if it is one second older than its arrival. Five refused stamps over 50
//   ms that agree with each other set the new clock. After a step back of less than 50 ms the stamps soon
//   pass the old ones; they still count as refused while their delay is nearer to that of the refused stamps
//   than to the line. A step ahead of up to 5 ms shows as a delay below the smallest; a step back by less
//   than a sample shows as at least 2 s without a delay near the smallest. After either the offset restarts
//   and the skew is kept.
// - Lost samples and outages do no harm; during an outage the line is extrapolated with its slope.
// - A constant delay that grows for more than 2 s is taken for a step back: the two cannot be distinguished.
//
// Errors: kInvalidInput, no stamp (reasons above; counted). Cost: 0.13 us per sample on average, about 2 us
// four times a second. Memory: 3 KiB, no allocation.

#include <cstdint>
#include <optional>

#include "drivers/timesync/delay_histogram.hpp"
#include "drivers/timesync/lower_envelope.hpp"
#include "drivers/timesync/rising_stamps.hpp"
#include "drivers/timesync/timesync_status.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

class ClockMap {
 public:
  /// `constant_delay`: smallest delay from sensing to arrival; subtracted.
  explicit ClockMap(Duration constant_delay = {}) : constant_delay_(constant_delay) {}

  /// Learns from one sample and maps it. `host` is written only if the status is ok.
  Status add(Stamp device, Stamp arrival, Stamp& host);
  /// Maps other stamps of the same clock. Does not learn and does not force stamps to rise. Empty before the
  /// first sample and for stamps out of range.
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const;

  [[nodiscard]] LockState lock() const;
  [[nodiscard]] TimesyncStatus status() const;

 private:
  /// Refused stamps. They become the new clock if they continue and agree with each other.
  struct Candidate {
    int count = 0;
    Stamp first_device, first_arrival, newest_device;
    Stamp lowest_device;
    std::int64_t lowest = 0;
  };
  [[nodiscard]] bool nearerToCandidate(std::int64_t delayed, double above) const;
  Status suspect(Stamp device, Stamp arrival, std::int64_t delayed, Stamp& host);
  [[nodiscard]] double tolerance(Stamp device) const;
  void watchForStepBack();
  Status handOut(Stamp device, Stamp arrival, Stamp& host);

  Duration constant_delay_;
  LowerEnvelope envelope_;
  DelayHistogram delays_;
  RisingStamps rising_;
  Candidate candidate_;
  Stamp newest_;
  Duration step_;                ///< from the previous sample, device clock
  std::uint64_t seen_bins_ = 0;  ///< envelope bins that watchForStepBack() has checked
  std::uint64_t samples_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace swiftlet
