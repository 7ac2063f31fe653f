#include "firmware_host/inspection/image_findings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

// A step of at least this many periods is a gap.
constexpr double kGap = 1.5;
// Below this share of missing images, tracks continue across them.
constexpr double kMissingShare = 0.02;
constexpr std::size_t kFewestMissing = 5;
// Steps of a free-running camera are within this share of the period; other cameras are triggered.
constexpr double kEven = 0.25;
constexpr double kEvenShare = 0.7;
// A doubled image: the scene stands still for one step, but moves before and after.
constexpr float kStill = 0.05F;  // px
constexpr float kMoving = 0.7F;  // px
constexpr std::size_t kFewestTracked = 20;
constexpr std::size_t kFewestDoubled = 3;
constexpr double kDoubledShare = 0.01;
// Exposure control changes brightness in steps of about 10 % (docs/exposure.md).
constexpr double kJump = 1.25;
constexpr std::size_t kFewestJumps = 3;
constexpr std::size_t kFewestOfStretch = 20;

double medianStep(const std::vector<Stamp>& stamps) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back((stamps[i] - stamps[i - 1]).seconds());
  if (steps.empty()) return 0;
  return medianOf(steps);
}

void addMissing(const std::vector<Stamp>& stamps, std::vector<Finding>& findings) {
  const double period = medianStep(stamps);
  if (period <= 0) return;
  std::size_t missing = 0;
  std::size_t even = 0;
  std::size_t short_steps = 0;
  double longest = 0;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const double step = (stamps[i] - stamps[i - 1]).seconds();
    if (step < kGap * period) {
      ++short_steps;
      even += std::abs(step - period) < kEven * period ? 1 : 0;
      continue;
    }
    missing += static_cast<std::size_t>(std::lround(step / period)) - 1;
    longest = std::max(longest, step);
  }
  const std::size_t whole = stamps.size() + missing;
  if (static_cast<double>(even) < kEvenShare * static_cast<double>(short_steps)) return;
  if (missing < kFewestMissing || static_cast<double>(missing) < kMissingShare * static_cast<double>(whole)) {
    return;
  }
  findings.push_back(
      {"images dropped",
       fmt::format("{} of {} images of camera 0 are missing, judged by their stamps (one every {:.4g} ms); "
                   "the longest step is {:.3f} s",
                   missing, whole, 1e3 * period, longest),
       "Reduce the load while recording: fewer topics, a faster disk, larger queues, or a lower rate"});
}

void addDoubled(const std::vector<TrackedImage>& images, std::vector<Finding>& findings) {
  std::size_t doubled = 0;
  std::size_t moving = 0;
  for (std::size_t i = 1; i + 1 < images.size(); ++i) {
    const auto tells = [&](std::size_t k) { return images[k].follows && images[k].kept >= kFewestTracked; };
    if (!tells(i) || !tells(i + 1)) continue;
    moving += images[i].flow > kMoving ? 1 : 0;
    if (images[i].flow > kStill) continue;
    // An image may be repeated up to this often; motion must continue before and after.
    constexpr std::size_t kMostRepeats = 3;
    std::size_t before = i;
    while (before > 0 && i - before < kMostRepeats && tells(before) && images[before].flow <= kStill)
      --before;
    std::size_t after = i;
    while (after + 1 < images.size() && after - i < kMostRepeats && tells(after) &&
           images[after].flow <= kStill) {
      ++after;
    }
    if (tells(before) && tells(after) && images[before].flow > kMoving && images[after].flow > kMoving)
      ++doubled;
  }
  if (doubled < kFewestDoubled ||
      static_cast<double>(doubled) < kDoubledShare * static_cast<double>(moving + doubled)) {
    return;
  }
  findings.push_back(
      {"images doubled",
       fmt::format("{} of {} images of camera 0 repeat the previous image under a new stamp during motion",
                   doubled, moving + doubled),
       "Use the camera's own images, not a video or topic that was converted to a higher rate"});
}

void addJumps(const std::vector<TrackedImage>& images, std::vector<Finding>& findings) {
  std::size_t jumps = 0;
  double largest = 1;
  std::size_t steps = 0;
  for (const TrackedImage& image : images) {
    if (!image.follows || image.kept < kFewestTracked) continue;
    ++steps;
    const double ratio = std::max(image.light, 1 / image.light);
    if (ratio > kJump) ++jumps;
    largest = std::max(largest, ratio);
  }
  if (jumps < kFewestJumps) return;
  findings.push_back({"exposure jumps",
                      fmt::format("the brightness of the same points changes by more than {:.0f} % from one "
                                  "image to the next in {} of {} steps, by up to {:.2f} times",
                                  100 * (kJump - 1), jumps, steps, largest),
                      "Fix exposure and gain, or use an exposure control with small steps"});
}

}  // namespace

std::vector<Finding> imageFindings(const std::vector<Stamp>& stamps,
                                   const std::vector<TrackedImage>& images) {
  std::vector<Finding> findings;
  addMissing(stamps, findings);
  addDoubled(images, findings);
  addJumps(images, findings);
  return findings;
}

std::vector<Stamp> evenStamps(const std::vector<Stamp>& stamps) {
  std::vector<Stamp> even = stamps;
  const double period = medianStep(stamps);
  for (std::size_t first = 0; first < stamps.size();) {
    std::size_t end = first + 1;
    while (end < stamps.size() && (stamps[end] - stamps[end - 1]).seconds() < kGap * period) ++end;
    const std::size_t count = end - first;
    if (count >= kFewestOfStretch) {
      // Least squares over the image's number, from -middle to middle.
      const double middle = 0.5 * static_cast<double>(count - 1);
      double mean = 0;
      double slope = 0;
      double squares = 0;
      for (std::size_t i = first; i < end; ++i) {
        const double seconds = (stamps[i] - stamps[first]).seconds();
        const double number = static_cast<double>(i - first) - middle;
        mean += seconds / static_cast<double>(count);
        slope += number * seconds;
        squares += number * number;
      }
      slope /= squares;
      for (std::size_t i = first; i < end; ++i) {
        const double number = static_cast<double>(i - first) - middle;
        even[i] = stamps[first] + Duration::fromSeconds(mean + slope * number);
      }
    }
    first = end;
  }
  return even;
}

}  // namespace swiftlet
