#pragma once
// Where IMU samples wait for a node that takes them up to the stamp of its frame.
//
// `Taker` has addImu(sample) and restart(timeline, first stamp), which is called before the first sample of a
// new time line (estimator/odometry/stamp_guard.hpp).

#include "estimator/core/limits.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/port.hpp"

namespace swiftlet {

class SampleIn final : public QueueIn<ImuArrival, kImuRing> {
 public:
  using QueueIn::QueueIn;

  /// The oldest sample; null when there is none, or none that the limit lets through.
  [[nodiscard]] const ImuArrival* next() { return upTo(limit_); }
  /// Whether a time line begins with this sample.
  [[nodiscard]] bool begins(const ImuArrival& arrival) const { return arrival.timeline != timeline_; }
  void drop() {
    taken_ = front()->number;
    timeline_ = front()->timeline;
    pop();
  }
  /// Hands samples to `taker`, in order: of a frame's time line those not later than `until`, and the first
  /// in any case, by which a repetition of the run knows that it has begun; all of time lines before it.
  template <typename Taker>
  void takeUntil(Stamp until, std::uint32_t timeline, Taker& taker) {
    if (limit_ != kNoLimit) return takeUpTo(limit_, taker);
    for (const ImuArrival* arrival = next(); arrival != nullptr; arrival = next()) {
      const bool beyond = arrival->timeline == timeline && !begins(*arrival) && arrival->sample.stamp > until;
      if (beyond || arrival->timeline > timeline) break;
      hand(*arrival, taker);
    }
  }
  /// The same for samples up to this number.
  template <typename Taker>
  void takeUpTo(std::uint64_t number, Taker& taker) {
    while (const ImuArrival* arrival = upTo(number)) hand(*arrival, taker);
  }
  /// The same where no frame has come for long and samples must not fill the queue: half of it is more than
  /// any frame will ask for.
  template <typename Taker>
  void takeSurplus(Taker& taker) {
    while (size() > kImuRing / 2) hand(*front(), taker);
  }
  /// Number of the newest sample taken.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  /// Of the newest sample taken.
  [[nodiscard]] std::uint32_t timeline() const { return timeline_; }

  /// Recorded schedule: takeUntil takes samples up to this number regardless of their stamps.
  void limit(std::uint64_t number) { limit_ = number; }
  static constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

 private:
  [[nodiscard]] const ImuArrival* upTo(std::uint64_t number) {
    const ImuArrival* arrival = front();
    return arrival != nullptr && arrival->number <= number ? arrival : nullptr;
  }
  template <typename Taker>
  void hand(const ImuArrival& arrival, Taker& taker) {
    if (begins(arrival)) taker.restart(arrival.timeline, arrival.sample.stamp);
    taker.addImu(arrival.sample);
    drop();
  }

  std::uint64_t taken_ = 0;
  std::uint32_t timeline_ = 0;
  std::uint64_t limit_ = kNoLimit;
};

}  // namespace swiftlet
