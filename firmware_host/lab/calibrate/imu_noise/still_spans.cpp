#include "firmware_host/lab/calibrate/imu_noise/still_spans.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr std::array<const char*, 6> kAxes = {"gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"};
// Sensor noise drifts by some ten per cent over hours of warming up; a hand on the table doubles it.
constexpr double kScatterTimes = 1.5;
// In sigmas of a deviation estimated from n samples, 1 / sqrt(2 n).
constexpr double kScatterSigmas = 8;
// Steps between neighbouring blocks, in sigmas of such steps, which are not normal while a sensor warms up.
constexpr double kStepSigmas = 10;
// Smaller steps are no motion for any sensor: a thousandth of a degree of tilt.
constexpr double kLeastGyroStep = 1e-5;   // rad/s
constexpr double kLeastAccelStep = 2e-4;  // m/s^2
// docs/imu.md: a rig at rest is below, a flight above, by the scatter of 0.1 s means over a second.
constexpr double kMostSlowGyro = 0.005;  // rad/s
constexpr double kMostSlowAccel = 0.05;  // m/s^2

/// The lower quartile.
double quarter(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 4);
  std::ranges::nth_element(values, at);
  return *at;
}

}  // namespace

void StillSpans::add(Stamp stamp, const ImuSix& reading) {
  if (!any_) {
    any_ = true;
    first_ = stamp;
    reference_ = reading;
  }
  last_ = stamp;
  const double t = (stamp - first_).seconds();
  const auto block = static_cast<std::size_t>(t);
  while (blocks_.size() < block) close();
  const auto part = static_cast<std::size_t>((t - static_cast<double>(block)) * kParts);
  Sums& sums = open_[std::min(part, kParts - 1)];
  const ImuSix value = reading - reference_;
  sums.count += 1;
  sums.sum += value;
  sums.squares += value.cwiseAbs2();
}

void StillSpans::close() {
  Sums all;
  for (const Sums& part : open_) {
    all.count += part.count;
    all.sum += part.sum;
    all.squares += part.squares;
  }
  Block block;
  block.count = all.count;
  if (all.count > 1) {
    block.mean = all.sum / all.count;
    block.deviation = (all.squares / all.count - block.mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
    ImuSix slow = ImuSix::Zero();
    double parts = 0;
    for (const Sums& part : open_) {
      if (part.count == 0) continue;
      slow += (part.sum / part.count - block.mean).cwiseAbs2();
      ++parts;
    }
    block.slow_gyro = static_cast<float>(std::sqrt(slow.head<3>().sum() / parts));
    block.slow_accel = static_cast<float>(std::sqrt(slow.tail<3>().sum() / parts));
  }
  blocks_.push_back(block);
  open_ = {};
}

void StillSpans::finish() {
  if (!any_) return;
  close();
  const auto full = [this](std::size_t i) { return blocks_[i].count > 1; };
  for (int axis = 0; axis < 6; ++axis) {
    std::vector<double> deviations;
    std::vector<double> steps;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (!full(i)) continue;
      deviations.push_back(blocks_[i].deviation[axis]);
      if (i > 0 && full(i - 1)) steps.push_back(std::abs(blocks_[i].mean[axis] - blocks_[i - 1].mean[axis]));
    }
    quiet_[axis] = quarter(deviations);
    // The lower quartile of normal absolute values is 0.319 sigma.
    constexpr double kQuarterOfNormal = 0.3186;
    const double step = std::max(kStepSigmas * quarter(steps) / kQuarterOfNormal,
                                 axis < 3 ? kLeastGyroStep : kLeastAccelStep);
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (!full(i)) continue;
      Block& block = blocks_[i];
      const double most =
          quiet_[axis] * std::max(kScatterTimes, 1 + kScatterSigmas / std::sqrt(2 * block.count));
      double times = most > 0 ? block.deviation[axis] / most : 0;
      if (i > 0 && full(i - 1)) {
        times = std::max(times, std::abs(block.mean[axis] - blocks_[i - 1].mean[axis]) / step);
      }
      if (times <= 1 || times < static_cast<double>(block.times)) continue;
      block.times = static_cast<float>(times);
      block.axis = axis;
    }
  }
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const std::size_t end = std::min(i + 2, blocks_.size());
    for (std::size_t k = i == 0 ? 0 : i - 1; k < end; ++k) blocks_[i].used &= blocks_[k].axis < 0;
  }
}

bool StillSpans::still(Stamp stamp) const {
  const auto block = static_cast<std::size_t>((stamp - first_).seconds());
  return block < blocks_.size() && blocks_[block].used;
}

double StillSpans::movingSeconds() const {
  const auto left_out = std::ranges::count_if(blocks_, [](const Block& block) { return !block.used; });
  return std::min(static_cast<double>(left_out), seconds());
}

std::vector<std::string> StillSpans::motions(std::size_t most) const {
  std::vector<std::string> lines;
  std::size_t further = 0;
  for (std::size_t i = 0; i < blocks_.size();) {
    std::size_t end = i;
    std::size_t worst = i;
    for (; end < blocks_.size() && !blocks_[end].used; ++end) {
      if (blocks_[end].times > blocks_[worst].times) worst = end;
    }
    if (end == i) {
      ++i;
      continue;
    }
    if (lines.size() == most) {
      ++further;
    } else {
      const Block& block = blocks_[worst];
      lines.push_back(fmt::format("{} to {} s: {}, {:.3g} times the limit for rest", i, end,
                                  kAxes[static_cast<std::size_t>(std::max(block.axis, 0))], block.times));
    }
    i = end;
  }
  if (further > 0) lines.push_back(fmt::format("and {} further spans", further));
  return lines;
}

std::string StillSpans::restless() const {
  std::vector<double> gyro;
  std::vector<double> accel;
  for (const Block& block : blocks_) {
    if (block.count < 2 * kParts) continue;
    gyro.push_back(static_cast<double>(block.slow_gyro));
    accel.push_back(static_cast<double>(block.slow_accel));
  }
  if (quarter(gyro) > kMostSlowGyro) {
    return fmt::format(
        "the 0.1 s means of the gyro scatter by {:.3g} rad/s in the quietest quarter of the log, "
        "above {:g} at rest",
        quarter(gyro), kMostSlowGyro);
  }
  if (quarter(accel) > kMostSlowAccel) {
    return fmt::format(
        "the 0.1 s means of the accelerometer scatter by {:.3g} m/s^2 in the quietest quarter of "
        "the log, above {:g} at rest",
        quarter(accel), kMostSlowAccel);
  }
  return {};
}

}  // namespace swiftlet
