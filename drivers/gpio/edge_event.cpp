#include "drivers/gpio/edge_event.hpp"

namespace swiftlet {
namespace {

// A larger gap is a counter that restarted (a day at 1 kHz is less).
constexpr std::uint32_t kMostMissed = 1U << 27U;

}  // namespace

std::uint64_t EdgeGaps::add(const EdgeEvent& event) {
  std::uint64_t lacking = 0;
  if (event.sequence) {
    const std::uint32_t gap = *event.sequence - sequence_ - 1;
    if (gap < kMostMissed) lacking = gap;
    sequence_ = *event.sequence;
  } else if (any_ && period_.ns > 0 && event.stamp > newest_) {
    // Unsigned, so that the difference of any two ordered stamps fits.
    const std::uint64_t passed =
        static_cast<std::uint64_t>(event.stamp.ns) - static_cast<std::uint64_t>(newest_.ns);
    const auto period = static_cast<std::uint64_t>(period_.ns);
    const std::uint64_t periods = passed / period + (passed % period > period / 2 ? 1 : 0);
    if (periods > 1 && periods <= kMostMissed) lacking = periods - 1;
  }
  any_ = true;
  newest_ = event.stamp;
  missed_ += lacking;
  return lacking;
}

}  // namespace swiftlet
