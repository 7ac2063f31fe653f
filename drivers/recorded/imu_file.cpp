#include "drivers/recorded/imu_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <sstream>

#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

constexpr std::array<const char*, 3> kGyroNames = {"gyro x", "gyro y", "gyro z"};
constexpr std::array<const char*, 3> kAccelNames = {"accel x", "accel y", "accel z"};

constexpr double kGyroPlausible = 10;  // rad/s, median; a higher one means deg/s
constexpr std::size_t kMaxProbed = 4000;

enum class Sensor : std::uint8_t { kOther, kGyro, kAccel };

/// Detects the sensor from a column's name: "w_RS_S_x", "gx", "omega_x", "angular_velocity.x" or "a_RS_S_x",
/// "ax", "acc_x", "linear_acceleration.x", in any case, with or without a unit.
Sensor sensorOf(std::string name) {
  std::erase_if(name, [](unsigned char c) { return std::isspace(c) != 0 || c == '"' || c == '#'; });
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const auto begins = [&name](std::initializer_list<const char*> words) {
    return std::ranges::any_of(words, [&name](const char* word) { return name.starts_with(word); });
  };
  if (begins({"w_", "wx", "wy", "wz", "g_", "gx", "gy", "gz", "gyr", "omega", "ang", "rot", "imu_gyr"})) {
    return Sensor::kGyro;
  }
  if (begins({"a_", "ax", "ay", "az", "acc", "lin", "spec", "f_", "imu_acc"})) return Sensor::kAccel;
  return Sensor::kOther;
}

/// Whether the first three columns after the stamp are named as the accelerometer and the next three as the
/// gyro.
bool accelFirst(const std::string& header) {
  std::size_t accel = 0;
  std::size_t gyro = 0;
  std::size_t column = 0;
  std::istringstream names(header);
  for (std::string name; std::getline(names, name, ','); ++column) {
    if (column >= 1 && column <= 3 && sensorOf(name) == Sensor::kAccel) ++accel;
    if (column >= 4 && column <= 6 && sensorOf(name) == Sensor::kGyro) ++gyro;
  }
  return accel == 3 && gyro == 3;
}

double medianNorm(const std::vector<ImuSample>& samples, Eigen::Vector3d ImuSample::*quantity) {
  std::vector<double> norms;
  const std::size_t step = samples.size() / kMaxProbed + 1;
  for (std::size_t i = 0; i < samples.size(); i += step) norms.push_back((samples[i].*quantity).norm());
  return medianOf(norms);
}

std::vector<ImuSample> readImuRows(CsvReader& csv, LogCounters& counters, LogWarnings& warnings) {
  std::vector<ImuSample> samples;
  ImuRows rows(csv, warnings);
  for (ImuSample sample; rows.next(sample);) samples.push_back(sample);
  orderSamples(samples, csv.name(), counters, warnings);
  checkUnits(samples, csv.name(), warnings);
  return samples;
}

}  // namespace

bool ImuRows::next(ImuSample& sample) {
  while (csv_.next(7)) {
    if (!any_) accel_first_ = accelFirst(csv_.header());
    if (!parseCsvStamp(csv_.field(0), sample.stamp)) {
      csv_.reject("timestamp", quoteInput(csv_.field(0)) + " is not a stamp in ns");
      continue;
    }
    if (!csv_.numbers(accel_first_ ? 4 : 1, kGyroNames, sample.gyro.data()) ||
        !csv_.numbers(accel_first_ ? 1 : 4, kAccelNames, sample.accel.data())) {
      continue;
    }
    any_ = true;
    return true;
  }
  csv_.finish("IMU samples", "Write each row as: stamp [ns], gyro x y z [rad/s], accel x y z [m/s^2]");
  if (accel_first_)
    warnings_.add(csv_.name() +
                  ": the header lists the accelerometer first; the columns are read in that order");
  return false;
}

void orderSamples(std::vector<ImuSample>& samples, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings) {
  orderByStamp(samples, name, counters, warnings);
}

ForceLevel forceLevel(const std::vector<ImuSample>& samples) {
  // Averages out a drone's rotors, which shake at 50 Hz and above.
  constexpr Duration kMean = Duration::fromMilliseconds(100);
  std::vector<double> sizes;
  for (std::size_t i = 0; i < samples.size();) {
    const Stamp begin = samples[i].stamp;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double count = 0;
    for (; i < samples.size() && samples[i].stamp - begin < kMean; ++i, ++count) sum += samples[i].accel;
    sizes.push_back(sum.norm() / count);
  }
  std::ranges::sort(sizes);
  if (sizes.empty()) return {};
  return {sizes[sizes.size() / 2], sizes[sizes.size() / 10]};
}

void checkUnits(const std::vector<ImuSample>& samples, const std::string& name, LogWarnings& warnings) {
  if (samples.empty()) return;
  const ForceLevel force = forceLevel(samples);
  const double gyro = medianNorm(samples, &ImuSample::gyro);
  const ForceLevel as_gyro{gyro, gyro};
  if (force.median < gyro && !force.hasGravity() && as_gyro.hasGravity()) {
    throw InputError(
        name, 0, "",
        fmt::format("the median gyro reading is {:.2f} and the median accel {:.2f}", gyro, force.median),
        "Gyro and accelerometer columns are swapped: put the gyro first, or name the columns in the header "
        "(gyro_x, ..., accel_x, ...)");
  }
  if (force.inG()) {
    throw InputError(name, 0, "accel", fmt::format("the median specific force is {:.3f}", force.median),
                     "The unit is m/s^2: is this in g?");
  }
  if (!force.hasGravity()) {
    warnings.add(name +
                 fmt::format(": the median specific force is {:.2f} m/s^2, far from 9.81", force.median));
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
  return 1e9 / static_cast<double>(medianOf(periods));
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
