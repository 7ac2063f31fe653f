#include "drivers/timesync/realtime_offset.hpp"

#include <algorithm>
#include <cstdlib>

#include "drivers/timesync/stamp_limit.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kInterval = 1'000'000'000;
constexpr std::int64_t kSlewShare = 2000;  // the kernel slews by at most 500 ppm: 1 / 2000

struct Best {
  std::int64_t offset = 0;
  std::int64_t bound = 0;
  bool found = false;
};

}  // namespace

Status RealtimeOffset::measure(std::span<const ClockReading> readings) {
  Best best;
  // Every reading says that the offset lies within; so do all together, unless it changed.
  std::int64_t low = -4 * kStampLimit + 1;
  std::int64_t high = 4 * (kStampLimit - 1);
  Stamp when;
  for (const ClockReading& r : readings) {
    const bool in_range = withinLimit(r.before) && withinLimit(r.real) && withinLimit(r.after);
    if (!in_range || r.after < r.before) continue;
    low = std::max(low, (r.real - r.after).ns);
    high = std::min(high, (r.real - r.before).ns);
    const std::int64_t apart = (r.after - r.before).ns;
    const std::int64_t bound = apart / 2 + apart % 2;
    if (best.found && bound >= best.bound) continue;
    best = {r.real.ns - (r.before.ns + apart / 2), bound, true};
    when = r.after;
  }
  if (!best.found) return {StatusCode::kInvalidInput, "no reading of the clocks is in order"};
  if (low > high) return {StatusCode::kNotReady, "the real-time clock stepped while it was read: read again"};
  if (any_) {
    const std::int64_t change = std::abs(best.offset - offset_.ns);
    const std::int64_t slewed = std::abs((when - measured_).ns) / kSlewShare;
    if (change > slewed + bound_.ns + best.bound) ++steps_;
  }
  offset_ = {best.offset};
  bound_ = {best.bound};
  measured_ = when;
  any_ = true;
  expired_ = false;
  return okStatus();
}

bool RealtimeOffset::due(Stamp now) const {
  if (!any_ || expired_ || !withinLimit(now)) return true;
  const std::int64_t since = (now - measured_).ns;
  return since >= kInterval || since < 0;
}

Status RealtimeOffset::toMonotonic(Stamp real, Stamp& monotonic) const {
  if (!any_) return {StatusCode::kNotReady, "the real-time clock was not measured yet"};
  if (!withinLimit(real)) return {StatusCode::kInvalidInput, "stamp out of range"};
  monotonic = real - offset_;
  return okStatus();
}

}  // namespace swiftlet
