#include "firmware_host/lab/calibrate/imu_noise/imu_noise_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "estimator/core/median.hpp"
#include "firmware_host/lab/calibrate/imu_noise/imu_source.hpp"
#include "firmware_host/lab/calibrate/imu_noise/still_spans.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kProbed = 4000;  // samples used to find rate and units
constexpr double kHolePeriods = 10;
constexpr double kLongestLog = 10 * 86400;  // s
constexpr double kLeastRest = 10;           // s; enough for ten clusters of 1 s
constexpr double kMostMotion = 0.5;         // of the log
constexpr std::size_t kMotionLines = 8;
constexpr std::array<const char*, 6> kNames = {"gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"};

ImuSix six(const ImuSample& sample) {
  ImuSix reading;
  reading << sample.gyro, sample.accel;
  return reading;
}

/// Mean time between samples without gaps, in which jitter cancels. The median of the first periods defines a
/// gap.
class Periods {
 public:
  void add(Stamp stamp) {
    if (last_) waiting_.push_back((stamp - *last_).seconds());
    last_ = stamp;
    if (waiting_.size() == kProbed) count();
  }
  double mean() {
    count();
    return sum_ / static_cast<double>(std::max<std::size_t>(count_, 1));
  }

 private:
  void count() {
    if (median_ == 0 && !waiting_.empty()) {
      median_ = medianOf(waiting_);
    }
    for (const double dt : waiting_) {
      if (dt >= kHolePeriods * median_) continue;
      sum_ += dt;
      ++count_;
    }
    waiting_.clear();
  }

  std::optional<Stamp> last_;
  std::vector<double> waiting_;
  double median_ = 0;
  double sum_ = 0;
  std::size_t count_ = 0;
};

/// Refuses time spans that no log has; their blocks would fill the memory.
void checkSpan(const std::string& log, const std::vector<ImuSample>& probe, Stamp last, Stamp stamp) {
  if ((stamp - probe.front().stamp).seconds() < kLongestLog) return;
  throw InputError(
      log, 0, "timestamp",
      fmt::format("jumps from {:.3f} to {:.3f} s; a log is shorter than {:.0f} days",
                  Duration{last.ns}.seconds(), Duration{stamp.ns}.seconds(), kLongestLog / 86400),
      "Remove the rows with the wrong stamps");
}

std::string axesText(const std::vector<int>& axes) {
  std::string text;
  for (const int axis : axes)
    text += (text.empty() ? "" : ", ") + std::string(kNames.at(static_cast<std::size_t>(axis)));
  return text;
}

std::vector<int> axesWhere(const std::function<bool(int)>& holds) {
  std::vector<int> axes;
  for (int axis = 0; axis < 6; ++axis) {
    if (holds(axis)) axes.push_back(axis);
  }
  return axes;
}

void addRemarks(ImuNoiseResult& result) {
  const auto& axis = result.axis;
  const auto at = [&](int i) -> const AxisNoise& { return axis[static_cast<std::size_t>(i)]; };
  const auto short_for = axesWhere([&](int i) { return !at(i).walk; });
  if (!short_for.empty()) {
    result.remarks.push_back(fmt::format(
        "The log is too short for the random walk of {}: {:.0f} s at rest do not determine it to {:.0f} %. "
        "Only white noise is given for these. Record at least two hours at an even temperature",
        axesText(short_for), result.used_seconds, 100 * kMostRelativeSigma));
  }
  const double nyquist = 2 / result.rate_hz;
  const auto quantized = axesWhere([&](int i) {
    // Compares the parts of the variance at two periods.
    return at(i).quantization > 0 &&
           3 * std::pow(at(i).quantization / nyquist, 2) > std::pow(at(i).density.value, 2) / nyquist;
  });
  if (!quantized.empty()) {
    result.remarks.push_back(
        "Quantization exceeds white noise at short times on " + axesText(quantized) +
        ". Choose a smaller measurement range of the sensor if the vehicle's motion allows it");
  }
  const auto misfit = axesWhere([&](int i) { return at(i).misfit > 2; });
  if (!misfit.empty()) {
    result.remarks.push_back("The deviation of " + axesText(misfit) +
                             " does not match white noise, bias instability and random walk: the place "
                             "vibrates, or the temperature changes. The standard deviations include the "
                             "misfit. Record again on a heavy table after the sensor has warmed up");
  }
  const auto filtered = axesWhere([&](int i) { return at(i).from_tau > result.points.front().tau; });
  if (!filtered.empty()) {
    result.remarks.push_back(
        fmt::format("Times below {:.3g} s are excluded for {}: the readings are not white there, as behind a "
                    "low-pass filter",
                    at(filtered.front()).from_tau, axesText(filtered)));
  }
}

double largest(const ImuNoiseResult& result, int first, double (*of)(const AxisNoise&)) {
  double most = 0;
  for (int i = first; i < first + 3; ++i) most = std::max(most, of(result.axis[static_cast<std::size_t>(i)]));
  return most;
}

std::string walkLine(const ImuNoiseResult& result, const char* key, int first) {
  const bool known = std::all_of(result.axis.begin() + first, result.axis.begin() + first + 3,
                                 [](const AxisNoise& a) { return a.walk.has_value(); });
  if (known) {
    return fmt::format("{}: {:.4g}\n", key,
                       largest(result, first, [](const AxisNoise& a) { return a.walk->value; }));
  }
  return fmt::format(
      "# {}: not measured, the log is too short. Below {:.2g} (2 sigma); use the data sheet's value.\n", key,
      largest(result, first, [](const AxisNoise& a) { return a.walk ? a.walk->value : a.walk_limit; }));
}

}  // namespace

ImuNoiseResult measureImuNoise(const std::string& log) {
  ImuNoiseResult result;
  result.log = log;
  StillSpans spans;
  Periods periods;
  std::vector<ImuSample> probe;
  Stamp newest;
  eachImuSample(
      log,
      [&](const ImuSample& sample) {
        if (probe.size() < kProbed) probe.push_back(sample);
        checkSpan(log, probe, newest, sample.stamp);
        newest = sample.stamp;
        periods.add(sample.stamp);
        spans.add(sample.stamp, six(sample));
      },
      result.warnings);
  LogWarnings units;
  checkUnits(probe, log, units);
  result.warnings.insert(result.warnings.end(), units.lines().begin(), units.lines().end());
  spans.finish();
  result.seconds = spans.seconds();
  result.motions = spans.motions(kMotionLines);
  const std::string restless = spans.restless();
  const double still = result.seconds - spans.movingSeconds();
  if (!restless.empty() || still < kLeastRest || spans.movingSeconds() > kMostMotion * result.seconds) {
    throw InputError(log, 0, "",
                     !restless.empty()
                         ? "is not at rest: " + restless
                         : fmt::format("is at rest for {:.0f} of {:.0f} s{}{}", still, result.seconds,
                                       result.motions.empty() ? "" : "; it moves from ",
                                       result.motions.empty() ? "" : result.motions.front()),
                     "Record the IMU at rest on a heavy table, motors off, for two hours or more");
  }
  const double period = periods.mean();
  result.rate_hz = 1 / period;
  AllanVariance variance(period);
  std::optional<Stamp> last;
  std::vector<std::string> again;
  eachImuSample(
      log,
      [&](const ImuSample& sample) {
        const bool hole = last && (sample.stamp - *last).seconds() > kHolePeriods * period;
        result.holes += hole ? 1 : 0;
        last = sample.stamp;
        const bool still_here = spans.still(sample.stamp);
        if (hole || !still_here) variance.interrupt();
        if (!still_here) return;
        variance.add(six(sample));
        ++result.samples;
      },
      again);
  result.used_seconds = static_cast<double>(result.samples) * period;
  result.points = variance.points();
  for (int axis = 0; axis < 6; ++axis) {
    result.axis[static_cast<std::size_t>(axis)] = fitNoise(result.points, axis);
  }
  const auto dead =
      axesWhere([&result](int i) { return !(result.axis[static_cast<std::size_t>(i)].density.value > 0); });
  if (!dead.empty()) {
    throw InputError(log, 0, axesText(dead), "never changes at rest: noise cannot be measured",
                     "Check the sensor and its driver, or choose a smaller measurement range");
  }
  addRemarks(result);
  return result;
}

std::string imuNoiseYaml(const ImuNoiseResult& result) {
  std::string text = fmt::format(
      "# Noise at rest, {:.0f} s, of the noisiest axis. swiftlet multiplies the densities itself in flight\n"
      "# (imu.gyro_inflation, imu.accel_inflation), so do not raise them here. Other estimators need "
      "densities\n"
      "# 10 to 20 times as large.\n",
      result.used_seconds);
  text += fmt::format("update_rate: {:.6g}\n", result.rate_hz);
  text += fmt::format("gyroscope_noise_density: {:.4g}\n",
                      largest(result, 0, [](const AxisNoise& a) { return a.density.value; }));
  text += walkLine(result, "gyroscope_random_walk", 0);
  text += fmt::format("accelerometer_noise_density: {:.4g}\n",
                      largest(result, 3, [](const AxisNoise& a) { return a.density.value; }));
  text += walkLine(result, "accelerometer_random_walk", 3);
  return text;
}

std::string imuNoiseText(const ImuNoiseResult& result) {
  std::string text = fmt::format("{}: {:.0f} s at {:.1f} Hz, {:.0f} s of it at rest, {} gaps\n", result.log,
                                 result.seconds, result.rate_hz, result.used_seconds, result.holes);
  for (const std::string& motion : result.motions) text += "  moves, excluded: " + motion + "\n";
  text += "axis      white noise density        random walk                bias instability\n";
  for (std::size_t i = 0; i < result.axis.size(); ++i) {
    const AxisNoise& a = result.axis[i];
    const std::string walk =
        a.walk ? fmt::format("{:.4g} +- {:.1f} %", a.walk->value, 100 * a.walk->sigma / a.walk->value)
               : fmt::format("not measured (below {:.2g})", a.walk_limit);
    text += fmt::format(
        "{:<8}  {:<25}  {:<25}  {}{:.3g} at {:.3g} s\n", kNames[i],
        fmt::format("{:.4g} +- {:.2f} %", a.density.value, 100 * a.density.sigma / a.density.value), walk,
        a.instability_reached ? "" : "below ", a.instability, a.instability_tau);
  }
  text +=
      "gyro [rad/s/sqrt(Hz)], [rad/s^2/sqrt(Hz)], [rad/s]; accel [m/s^2/sqrt(Hz)], [m/s^3/sqrt(Hz)], "
      "[m/s^2]\n";
  for (const std::string& remark : result.remarks) text += remark + ".\n";
  return text;
}

}  // namespace swiftlet
