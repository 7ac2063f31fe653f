#pragma once
// Queue of IMU samples for a node that takes them up to the stamp of its frame.
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

  /// The oldest sample; null if there is none, or none within the limit.
  [[nodiscard]] const ImuArrival* next() { return upTo(limit_); }
  /// Whether a new time line begins with this sample.
  [[nodiscard]] bool begins(const ImuArrival& arrival) const { return arrival.timeline != timeline_; }
  void drop() {
    taken_ = front()->number;
    timeline_ = front()->timeline;
    pop();
  }
  /// Hands samples to `taker` in order: all of earlier time lines, and those of the frame's time line that
  /// are not later than `until`. The first sample of the frame's time line is always taken, so that a
  /// repetition of the run knows that it has begun.
  template <typename Taker>
  void takeUntil(Stamp until, std::uint32_t timeline, Taker& taker) {
    if (limit_ != kNoLimit) return takeUpTo(limit_, taker);
    for (const ImuArrival* arrival = next(); arrival != nullptr; arrival = next()) {
      const bool beyond = arrival->timeline == timeline && !begins(*arrival) && arrival->sample.stamp > until;
      if (beyond || arrival->timeline > timeline) break;
      hand(*arrival, taker);
    }
  }
  /// Hands over the samples up to this number.
  template <typename Taker>
  void takeUpTo(std::uint64_t number, Taker& taker) {
    while (const ImuArrival* arrival = upTo(number)) hand(*arrival, taker);
  }
  /// Keeps samples from filling the queue when no frame has arrived for long: hands over all but the newest
  /// half of its capacity, which is more than any frame needs.
  template <typename Taker>
  void takeSurplus(Taker& taker) {
    while (size() > kImuRing / 2) hand(*front(), taker);
  }
  /// Number of the newest sample taken.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  /// Time line of the newest sample taken.
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
