#include "firmware_host/inputs/devices/counting_sink.hpp"

#include <algorithm>
#include <utility>

namespace swiftlet {
namespace {

std::vector<Duration> steps(const std::vector<Stamp>& stamps) {
  std::vector<Duration> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
  std::ranges::sort(steps);
  return steps;
}

Duration distance(Stamp a, Stamp b) { return a < b ? b - a : a - b; }

/// Percentile by nearest rank; 0 for no values.
Duration percentile(std::vector<Duration> values, double share) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size()));
  return values[std::min(rank, values.size() - 1)];
}

}  // namespace

CountingSink::CountingSink(std::size_t most) {
  imu_.stamps.reserve(most);
  for (Stream& camera : camera_) {
    camera.stamps.reserve(most);
    camera.latencies.reserve(most);
  }
}

void CountingSink::keep(Stream& stream, Stamp stamp) {
  if (stream.stamps.size() == stream.stamps.capacity()) {
    ++stream.beyond;
    return;
  }
  stream.stamps.push_back(stamp);
}

double CountingSink::Stream::rate() const {
  if (stamps.size() < 2) return 0;
  const double seconds = (stamps.back() - stamps.front()).seconds();
  return seconds > 0 ? static_cast<double>(stamps.size() - 1) / seconds : 0;
}

Duration CountingSink::Stream::largestStep() const {
  const std::vector<Duration> sorted = steps(stamps);
  return sorted.empty() ? Duration{} : sorted.back();
}

Duration CountingSink::Stream::medianStep() const {
  const std::vector<Duration> sorted = steps(stamps);
  return sorted.empty() ? Duration{} : sorted[sorted.size() / 2];
}

Duration CountingSink::Stream::jitter(double share) const {
  std::vector<Duration> off = steps(stamps);
  const Duration typical = medianStep();
  if (typical <= Duration{}) return {};
  for (Duration& step : off) {
    // Also for a step over lost frames: its distance from a whole multiple of the median.
    const std::int64_t over = ((step.ns % typical.ns) + typical.ns) % typical.ns;
    step.ns = std::min(over, typical.ns - over);
  }
  return percentile(std::move(off), share);
}

Duration CountingSink::Stream::latency(double share) const { return percentile(latencies, share); }

std::vector<Duration> CountingSink::pairDistances() const {
  std::vector<Duration> distances;
  std::vector<Stamp> left = camera_[0].stamps;
  if (left.empty()) return distances;
  // A driver may deliver stamps out of order.
  std::ranges::sort(left);
  for (const Stamp stamp : camera_[1].stamps) {
    const auto after = std::ranges::lower_bound(left, stamp);
    Duration nearest = after != left.end() ? distance(*after, stamp) : distance(left.back(), stamp);
    if (after != left.begin()) nearest = std::min(nearest, distance(*(after - 1), stamp));
    distances.push_back(nearest);
  }
  std::ranges::sort(distances);
  return distances;
}

}  // namespace swiftlet
