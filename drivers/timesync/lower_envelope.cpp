#include "drivers/timesync/lower_envelope.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

constexpr std::int64_t kWindow = static_cast<std::int64_t>(LowerEnvelope::kBins) *
                                 LowerEnvelope::kBinWidth.ns;  // 32 s: shorter than a crystal's warm-up
// After an outage the old points support the line until the new ones suffice alone: 2 s of them.
constexpr std::size_t kAloneFrom = 8;
// Shortest span for a slope. A slope from a longer span is not replaced by one from a shorter span.
constexpr std::int64_t kFirstSpan = 2'000'000'000;
constexpr std::int64_t kLaterSpan = 8'000'000'000;
// Crystals are within 100 ppm; the rest is margin for the host's clock. A bound keeps steps of the clock and
// jitter out of the slope.
constexpr double kCrystalSlope = 150e-6;
// Steeper clocks exist: ceramic and RC oscillators are off by up to 2 %, and chrony slews the host's clock by
// up to 8.3 %. They are recognized by points that lie near a steep line. A line through the points before and
// after a step of the clock leaves at least half of the distances of a line that ignores the step.
constexpr double kSteepest = 0.1;
constexpr double kFarBetter = 3;
// A steep slope, once known, is followed: temperature changes it by less than this factor within a window.
constexpr double kSteepFactor = 1.5;
// The lowest of n evenly distributed points lie a few times mean / n above the true line. The factor is the
// 99 % point of the simulated clocks in tests/drivers/timesync.
constexpr double kFitFactor = 4;
constexpr double kWander = 2e-6;  // change of a crystal's rate in flight between windows
// The line is not extrapolated beyond this value [ns], which keeps the sum within int64.
constexpr double kFarthest = 1e18;

}  // namespace

Duration LowerEnvelope::span() const { return {count_ == 0 ? 0 : point(count_ - 1).time - point(0).time}; }

// In double: the difference of two heights of arbitrary stamps can exceed int64.
double LowerEnvelope::rise(const Point& from, const Point& to) {
  return static_cast<double>(to.value) - static_cast<double>(from.value);
}

double LowerEnvelope::line(std::int64_t time) const {
  return level_ + slope_ * static_cast<double>(time - reference_);
}

std::int64_t LowerEnvelope::at(Stamp time) const {
  const double from_reference = static_cast<double>(time.ns - origin_.ns) - static_cast<double>(reference_);
  const double value = level_ + slope_ * from_reference;
  return base_ + std::llround(std::clamp(value, -kFarthest, kFarthest));
}

double LowerEnvelope::heightOf(Stamp time, std::int64_t value_ns) const {
  return height({time.ns - origin_.ns, value_ns - base_});
}

double LowerEnvelope::uncertainty(Stamp time) const {
  if (count_ == 0) return std::numeric_limits<double>::infinity();
  const double fit = kFitFactor * mean_excess_ / static_cast<double>(count_);
  const double ahead =
      std::abs(static_cast<double>(time.ns - origin_.ns) - static_cast<double>(point(count_ - 1).time));
  const double half_span = static_cast<double>(span().ns) / 2;
  const double of_slope = slope_known_ ? kWander : kCrystalSlope;
  return fit + of_slope * ahead + (slope_known_ ? 0 : kCrystalSlope * half_span);
}

bool LowerEnvelope::raised(std::size_t fewest, double tolerance, double surprise, Stamp& since) const {
  if (count_ < fewest + 2) return false;
  tolerance += kFitFactor * mean_excess_ / static_cast<double>(count_);
  double lowest = std::numeric_limits<double>::infinity();
  double most = 0;
  // The newest bin is not complete; at least one older bin must have been on the line.
  for (std::size_t n = 1; n + 2 <= count_; ++n) {
    const Point& p = point(count_ - 1 - n);
    lowest = std::min(lowest, height(p));
    const double excess = lowest - tolerance;
    if (excess <= 0) break;
    const double found = static_cast<double>(n) * excess;
    if (n < fewest || found < surprise * roughness_ || found <= most) continue;
    most = found;
    since = {origin_.ns + p.time};
  }
  return most > 0;
}

void LowerEnvelope::dropOldest() {
  first_ = (first_ + 1) % kBins;
  --count_;
}

void LowerEnvelope::dropBefore(Stamp time) {
  while (count_ > 1 && origin_.ns + point(0).time < time.ns) dropOldest();
  if (count_ > 0) fit();
}

void LowerEnvelope::add(Stamp time, std::int64_t value_ns) {
  if (count_ == 0) {
    origin_ = time;
    base_ = value_ns;
    first_ = 0;
    bin_ = 0;
  }
  const Point p = {time.ns - origin_.ns, value_ns - base_};
  const std::int64_t bin = p.time / kBinWidth.ns;
  if (count_ > 0 && bin == bin_) {
    Point& lowest = point(count_ - 1);
    if (height(p) >= height(lowest)) return;
    lowest = p;
    if (height(p) < 0) fit();
    return;
  }
  if (count_ == kBins) dropOldest();
  point(count_++) = p;
  bin_ = bin;
  ++closed_;
  while (count_ > kAloneFrom && point(count_ - kAloneFrom).time > point(0).time + kWindow) dropOldest();
  fit();
}

void LowerEnvelope::fit() {
  std::array<std::size_t, kBins> hull;
  std::size_t n = 0;
  double mean_time = 0;   // since the oldest point
  double mean_value = 0;  // above the oldest point
  const std::int64_t oldest = point(0).time;
  for (std::size_t i = 0; i < count_; ++i) {
    const Point& p = point(i);
    mean_time += static_cast<double>(p.time - oldest);
    mean_value += rise(point(0), p);
    while (n >= 2) {
      const Point& a = point(hull[n - 2]);
      const Point& b = point(hull[n - 1]);
      const double turn = static_cast<double>(b.time - a.time) * rise(a, p) -
                          static_cast<double>(p.time - a.time) * rise(a, b);
      if (turn > 0) break;
      --n;
    }
    hull[n++] = i;
  }
  mean_time /= static_cast<double>(count_);
  mean_value /= static_cast<double>(count_);
  // The highest line of a slope below all points: its height at the oldest point, and the mean distance to
  // it.
  const auto levelOf = [&](double slope) {
    double level = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const Point& p = point(hull[i]);
      level = std::min(level, rise(point(0), p) - slope * static_cast<double>(p.time - oldest));
    }
    return level;
  };
  const auto distanceOf = [&](double slope) { return mean_value - slope * mean_time - levelOf(slope); };

  if (span().ns >= kFirstSpan) {
    std::size_t edge = 0;
    while (edge + 2 < n && static_cast<double>(point(hull[edge + 1]).time - oldest) < mean_time) ++edge;
    const Point& a = point(hull[edge]);
    const Point& b = point(hull[edge + 1]);
    const double best = rise(a, b) / static_cast<double>(b.time - a.time);
    const bool long_enough = span().ns >= std::min(slope_span_, kLaterSpan);
    const bool steep = std::abs(slope_) > kCrystalSlope;
    const double bound = steep ? kSteepFactor * std::abs(slope_) : kCrystalSlope;
    const double usual = long_enough ? std::clamp(best, -bound, bound) : slope_;
    const bool other_rate = std::abs(best) <= kSteepest && kFarBetter * distanceOf(best) < distanceOf(usual);
    if (long_enough || other_rate) {
      slope_ = other_rate ? best : usual;
      slope_known_ = true;
      slope_span_ = span().ns;
    }
  }
  reference_ = point(count_ - 1).time;
  level_ = static_cast<double>(point(0).value) + levelOf(slope_) +
           slope_ * static_cast<double>(reference_ - oldest);
  double sum = 0;
  double changes = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    sum += height(point(i));
    if (i > 0) changes += std::abs(height(point(i)) - height(point(i - 1)));
  }
  mean_excess_ = sum / static_cast<double>(count_);
  roughness_ = count_ < 2 ? 0 : changes / static_cast<double>(count_ - 1);
}

}  // namespace swiftlet
