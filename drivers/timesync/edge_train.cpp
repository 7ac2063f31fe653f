#include "drivers/timesync/edge_train.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/timesync/stamp_limit.hpp"

namespace swiftlet {
namespace {

constexpr double kOnGrid = 0.1;  // periods: above a trigger's jitter; TriggerMatcher's bounds assume it
constexpr std::int64_t kLongestGap =
    16;  // periods; over this long the tracked period stays accurate to a fraction of kOnGrid
constexpr std::int64_t kAhead = 4;  // periods: a frame can arrive before its edge is read
constexpr int kOtherGrid = 4;
// Alpha-beta filter: the grid follows a jittering trigger slowly, the period even more slowly.
constexpr double kPhaseGain = 0.25;
constexpr double kPeriodGain = 0.03;
constexpr double kPeriodBound = 0.05;  // of nominal

double apart(Stamp from, Stamp to) { return static_cast<double>(to.ns - from.ns); }

}  // namespace

EdgeTrain::EdgeTrain(Duration period)
    : nominal_(static_cast<double>(std::max<std::int64_t>(period.ns, 1))), period_(nominal_) {}

void EdgeTrain::restart(Stamp edge) {
  slots_.fill({});
  newest_ = 0;
  slots_[0] = {0, edge};
  grid_ = edge;
  if (any_) ++epoch_;
  any_ = true;
  others_ = 0;
  sequence_.reset();
}

void EdgeTrain::offGrid(Stamp edge) {
  ++glitches_;
  const double periods = apart(other_, edge) / period_;
  const bool agrees = others_ > 0 && periods > 0.5 && periods < static_cast<double>(kLongestGap) &&
                      std::abs(periods - std::round(periods)) <= kOnGrid;
  others_ = agrees ? others_ + 1 : 1;
  other_ = edge;
  if (others_ < kOtherGrid) return;
  glitches_ -= static_cast<std::uint64_t>(others_);
  restart(edge);
}

void EdgeTrain::add(Stamp edge, std::optional<std::uint32_t> sequence) {
  if (!withinLimit(edge)) {
    ++glitches_;
    return;
  }
  ++edges_;
  const std::optional<std::uint32_t> before = sequence_;
  if (!any_ || apart(grid_, edge) > static_cast<double>(kLongestGap) * period_) {
    restart(edge);
    sequence_ = sequence;
    return;
  }
  sequence_ = sequence;
  const double periods = apart(grid_, edge) / period_;
  const double place = std::round(periods);
  if (place < 0 || std::abs(periods - place) > kOnGrid) {
    offGrid(edge);
    return;
  }
  others_ = 0;
  const double off = (periods - place) * period_;
  if (place == 0) {
    ++glitches_;
    Slot& known = slots_[static_cast<std::size_t>(newest_) % kKept];
    if (std::abs(off) < std::abs(apart(grid_, known.stamp))) known.stamp = edge;
    return;
  }
  const auto steps = static_cast<std::int64_t>(place);
  // Consecutive kernel numbers: no event was lost between them.
  const bool none_lost = before && sequence && *sequence - *before == 1;
  if (!none_lost) missed_ += static_cast<std::uint64_t>(steps - 1);
  newest_ += steps;
  slots_[static_cast<std::size_t>(newest_) % kKept] = {newest_, edge};
  grid_.ns += std::llround(place * period_ + kPhaseGain * off);
  period_ = std::clamp(period_ + kPeriodGain * off / place, nominal_ * (1 - kPeriodBound),
                       nominal_ * (1 + kPeriodBound));
}

const EdgeTrain::Slot* EdgeTrain::slot(std::int64_t index) const {
  if (index < 0) return nullptr;
  const Slot& s = slots_[static_cast<std::size_t>(index) % kKept];
  return s.index == index ? &s : nullptr;
}

std::optional<EdgeTrain::Edge> EdgeTrain::at(std::int64_t index) const {
  if (!any_ || index < 0 || index > newest_ + kAhead) return std::nullopt;
  if (const Slot* known = slot(index)) return Edge{known->stamp, true};
  const auto from = [&](Stamp stamp, std::int64_t steps) {
    return Edge{{stamp.ns + std::llround(static_cast<double>(steps) * period_)}, false};
  };
  // Do not extrapolate while edges are off the grid: a new grid may have begun.
  if (index > newest_ && others_ > 0) return std::nullopt;
  if (index > newest_) return from(grid_, index - newest_);
  for (std::int64_t n = 1; n <= kLongestGap; ++n) {
    if (const Slot* earlier = slot(index - n)) return from(earlier->stamp, n);
    if (const Slot* later = slot(index + n)) return from(later->stamp, -n);
  }
  return std::nullopt;
}

std::optional<std::int64_t> EdgeTrain::nearest(Stamp stamp) const {
  if (!any_ || !withinLimit(stamp)) return std::nullopt;
  const double periods = std::round(apart(grid_, stamp) / period_);
  if (std::abs(periods) > static_cast<double>(kKept)) return std::nullopt;
  return newest_ + static_cast<std::int64_t>(periods);
}

}  // namespace swiftlet
