#include "drivers/serial/device_count.hpp"

#include <limits>

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

// A longer gap is an interruption, not a number of lost samples.
constexpr Duration kLongestGap = Duration::fromMilliseconds(2'000);
// Half of the smallest counter's range.
constexpr std::uint64_t kLongestCount = 0x8000;

}  // namespace

SampleGaps::Step SampleGaps::step(std::optional<Stamp> device, std::optional<std::uint64_t> counter) {
  Step found;
  if (counter && counter_) {
    const std::uint64_t count = *counter - *counter_;
    if (count > 0 && count < kLongestCount) found.missing = count - 1;
    found.went_back = count >= kLongestCount;
  }
  if (device && device_) {
    if (*device < *device_) {
      found.went_back = true;
      step_count_ = 0;
    } else if (!counter) {
      found.missing = missingByClock(*device - *device_);
    }
  }
  device_ = device;
  counter_ = counter;
  return found;
}

std::optional<Duration> SampleGaps::usualStep() const {
  if (step_count_ < kSteps) return {};
  std::array<std::int64_t, kSteps> sorted = steps_;
  return Duration{medianOf(sorted)};
}

std::uint64_t SampleGaps::missingByClock(Duration step) {
  std::uint64_t missing = 0;
  const std::optional<Duration> usual = usualStep();
  if (usual && usual->ns > 0 && step < kLongestGap) {
    missing = static_cast<std::uint64_t>((step.ns + usual->ns / 2) / usual->ns);
    if (missing > 0) --missing;
  }
  steps_[step_count_ % kSteps] = step.ns;
  ++step_count_;
  return missing;
}

void SampleGaps::forget() {
  step_count_ = 0;
  device_.reset();
  counter_.reset();
}

std::optional<Stamp> stampOf(std::uint64_t value, std::uint64_t ns_per_unit) {
  constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (value > kMost / ns_per_unit) return {};
  return Stamp{static_cast<std::int64_t>(value * ns_per_unit)};
}

}  // namespace swiftlet
