#pragma once
// From a sensor's own clock to the host's CLOCK_MONOTONIC, where only the sensor speaks.
//
// In: pairs (device stamp, arrival). Out, at once: the host's stamp of the device stamp. With x the device
// stamp, arrival - x = offset(x) + constant delay + jitter, jitter >= 0: the offset is the lower envelope
// (lower_envelope.hpp). What no one-way link can tell stays in: the constant delay; set it where it is known.
//
// - Stamps that are handed out rise strictly (rising_stamps.hpp) and are never after the arrival, but for
//   what rising asks of them.
// - The device's clock steps: a stamp that repeats or goes back, that lies before what the delay allows, or a
//   second older than its arrival, is refused; five such that agree with each other for 50 ms are a new
//   clock. A step back by less than that lasts no longer than it, and is followed on: what comes after it
//   lies nearer to the stamps that went back than to the line. A smaller step ahead shows as a delay below
//   the smallest, one back by less than a sample as 2 s or more without a delay near it. The offset then
//   starts anew, the skew is kept.
// - Lost samples and outages cost nothing; through an outage the line is carried on at its slope.
// - A constant delay that grows for more than 2 s looks like a step back: nothing else can be told.
//
// Errors: kInvalidInput, no stamp (the reasons above; counted). Cost: 0.13 us a sample on average, about 2 us
// four times a second. Memory: 3 KiB, nothing allocated.

#include <cstdint>
#include <optional>

#include "drivers/timesync/delay_histogram.hpp"
#include "drivers/timesync/lower_envelope.hpp"
#include "drivers/timesync/rising_stamps.hpp"
#include "drivers/timesync/timesync_status.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

struct ClockMapSettings {
  Duration constant_delay;    ///< sensing to arrival when nothing delays it; subtracted
  double max_skew_ppm = 150;  ///< crystals are within 100; the margin is the host's own
};

class ClockMap {
 public:
  explicit ClockMap(const ClockMapSettings& settings = {});

  /// Learns from one sample and maps it. `host` is written when the status is ok.
  Status add(Stamp device, Stamp arrival, Stamp& host);
  /// Maps without learning and without rising: stamps of other things on the same clock. Empty before the
  /// first sample and for stamps that cannot be.
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const;

  [[nodiscard]] LockState lock() const;
  [[nodiscard]] TimesyncStatus status() const;

 private:
  /// Stamps that do not fit: a new clock if they continue and agree with each other.
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

  ClockMapSettings settings_;
  LowerEnvelope envelope_;
  DelayHistogram delays_;
  RisingStamps rising_;
  Candidate candidate_;
  Stamp newest_;
  Duration step_;                ///< from the sample before
  std::uint64_t seen_bins_ = 0;  ///< of the envelope's, that watchForStepBack has looked at
  std::uint64_t samples_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace swiftlet
