#include "drivers/recorded/imu_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

constexpr std::array<const char*, 3> kGyroNames = {"gyro x", "gyro y", "gyro z"};
constexpr std::array<const char*, 3> kAccelNames = {"accel x", "accel y", "accel z"};

// The norm of the specific force has a median near 9.81 on any vehicle that hovers, flies or stands;
// the bounds leave room for 40 % scale error and sustained manoeuvres.
constexpr double kGravityLow = 6;
constexpr double kGravityHigh = 16;
constexpr double kInG = 2;             // m/s^2; below this the unit is g
constexpr double kGyroPlausible = 10;  // rad/s, median; above it the unit is deg/s
constexpr std::size_t kMaxProbed = 4000;

bool accelFirst(const std::string& header) {
  const std::size_t accel = std::min(header.find("a_RS"), header.find("acc"));
  const std::size_t gyro = std::min({header.find("w_RS"), header.find("gyr"), header.find("omega")});
  return accel != std::string::npos && gyro != std::string::npos && accel < gyro;
}

double medianNorm(const std::vector<ImuSample>& samples, Eigen::Vector3d ImuSample::*quantity) {
  std::vector<double> norms;
  const std::size_t step = samples.size() / kMaxProbed + 1;
  for (std::size_t i = 0; i < samples.size(); i += step) norms.push_back((samples[i].*quantity).norm());
  const auto middle = norms.begin() + static_cast<std::ptrdiff_t>(norms.size() / 2);
  std::nth_element(norms.begin(), middle, norms.end());
  return *middle;
}

std::vector<ImuSample> readImuRows(CsvReader& csv, LogCounters& counters, LogWarnings& warnings) {
  std::vector<ImuSample> samples;
  bool accel_first = false;
  while (csv.next(7)) {
    if (samples.empty()) accel_first = accelFirst(csv.header());
    ImuSample sample;
    if (!parseCsvStamp(csv.field(0), sample.stamp)) {
      csv.reject("timestamp", "`" + std::string(csv.field(0).substr(0, 40)) + "` is not a stamp in ns");
      continue;
    }
    if (csv.numbers(accel_first ? 4 : 1, kGyroNames, sample.gyro.data()) &&
        csv.numbers(accel_first ? 1 : 4, kAccelNames, sample.accel.data())) {
      samples.push_back(sample);
    }
  }
  csv.finish("IMU samples", "A row is: stamp [ns], gyro x y z [rad/s], accel x y z [m/s^2]");
  if (accel_first) warnings.add(csv.name() + ": the header names the accelerometer first; read that way");
  orderSamples(samples, csv.name(), counters, warnings);
  checkUnits(samples, csv.name(), warnings);
  return samples;
}

}  // namespace

void orderSamples(std::vector<ImuSample>& samples, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings) {
  orderByStamp(samples, name, counters, warnings);
}

void checkUnits(const std::vector<ImuSample>& samples, const std::string& name, LogWarnings& warnings) {
  if (samples.empty()) return;
  const double accel = medianNorm(samples, &ImuSample::accel);
  const double gyro = medianNorm(samples, &ImuSample::gyro);
  if (accel < kGravityLow && gyro > kGravityLow && gyro < kGravityHigh) {
    throw InputError(
        name, 0, "",
        fmt::format("the median gyro reading is {:.2f} and the median accel {:.2f}", gyro, accel),
        "Gyro and accelerometer columns are swapped: gyro comes first");
  }
  if (accel < kInG && accel > 0.5) {
    throw InputError(name, 0, "accel", fmt::format("the median specific force is {:.3f}", accel),
                     "The unit is m/s^2: is this in g?");
  }
  if (accel < kGravityLow || accel > kGravityHigh) {
    warnings.add(name + fmt::format(": the median specific force is {:.2f} m/s^2, far from 9.81", accel));
  }
  if (gyro > kGyroPlausible) {
    warnings.add(name + fmt::format(": the median rate is {:.1f} rad/s: is the gyro in deg/s?", gyro));
  }
}

double medianRate(const std::vector<ImuSample>& samples) {
  if (samples.size() < 2) return 0;
  std::vector<std::int64_t> periods;
  for (std::size_t i = 1; i < std::min(samples.size(), kMaxProbed); ++i) {
    periods.push_back((samples[i].stamp - samples[i - 1].stamp).ns);
  }
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return 1e9 / static_cast<double>(*middle);
}

std::vector<ImuSample> readImuFile(const std::string& path, LogCounters& counters, LogWarnings& warnings) {
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  return readImuRows(csv, counters, warnings);
}

std::vector<ImuSample> readImuText(const std::string& name, std::string_view text, LogCounters& counters,
                                   LogWarnings& warnings) {
  CsvReader csv(name, text, CsvReader::Separator::kComma, counters, warnings);
  return readImuRows(csv, counters, warnings);
}

}  // namespace swiftlet
