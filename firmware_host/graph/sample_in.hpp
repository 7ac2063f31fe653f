#pragma once
// Where IMU samples wait for a node that takes them up to the stamp of its frame.

#include "estimator/core/limits.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/port.hpp"

namespace swiftlet {

class SampleIn final : public QueueIn<ImuArrival, kImuRing> {
 public:
  using QueueIn::QueueIn;

  /// The oldest sample; null when there is none, or none that the limit lets through.
  [[nodiscard]] const ImuArrival* next() { return taken_ < limit_ ? front() : nullptr; }
  void drop() {
    pop();
    ++taken_;
  }
  /// Hands samples not later than `until` to `take`, in order.
  template <typename Take>
  void takeUntil(Stamp until, Take&& take) {
    for (const ImuArrival* arrival = next(); arrival != nullptr; arrival = next()) {
      if (limit_ == kNoLimit && arrival->sample.stamp > until) break;
      take(arrival->sample);
      drop();
    }
  }
  /// The same where no frame has come for long and samples must not fill the queue: half of it is more than
  /// any frame will ask for.
  template <typename Take>
  void takeSurplus(Take&& take) {
    while (size() > kImuRing / 2) {
      take(front()->sample);
      drop();
    }
  }
  /// Samples taken so far.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }

  /// Recorded schedule: takeUntil takes just as many as make this total, whatever their stamps.
  void limit(std::uint64_t total) { limit_ = total; }
  /// Whether so many have come.
  [[nodiscard]] bool has(std::uint64_t total) const { return taken_ + size() >= total; }
  static constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

 private:
  std::uint64_t taken_ = 0;
  std::uint64_t limit_ = kNoLimit;
};

}  // namespace swiftlet
