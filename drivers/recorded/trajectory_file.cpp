#include "drivers/recorded/trajectory_file.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

constexpr double kQuaternionTolerance = 1e-3;
constexpr double kSecondsBelow = 1e11;
constexpr double kNanosecondsAbove = 1e14;
constexpr std::size_t kMotionColumns = 17;

constexpr std::array<const char*, 7> kTumNames = {"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
constexpr std::array<const char*, 7> kCsvNames = {"px", "py", "pz", "qw", "qx", "qy", "qz"};
constexpr std::array<const char*, 9> kMotionNames = {"vx",  "vy",  "vz",  "bgx", "bgy",
                                                     "bgz", "bax", "bay", "baz"};

enum class StampUnit { kUnknown, kSeconds, kNanoseconds };

/// The unit of a TUM file's stamps, determined from its first row.
StampUnit stampUnit(const CsvReader& csv) {
  double value = 0;
  if (!parseDouble(csv.field(0), value) || !std::isfinite(value)) return StampUnit::kUnknown;
  if (value < kSecondsBelow) return StampUnit::kSeconds;
  if (value > kNanosecondsAbove) return StampUnit::kNanoseconds;
  throw csv.error("timestamp", "neither seconds (below 1e11) nor nanoseconds (above 1e14)",
                  "Write stamps in seconds with 9 decimals");
}

bool setPose(CsvReader& csv, const Eigen::Vector3d& p, const Eigen::Quaterniond& q, TrajectoryPoint& point) {
  if (!(std::abs(q.norm() - 1) <= kQuaternionTolerance)) {
    csv.reject("quaternion", fmt::format("its norm is {:.4g}, not 1", q.norm()));
    return false;
  }
  point.T_world_body = SE3(q, p);
  return true;
}

bool readTumRow(CsvReader& csv, StampUnit& unit, TrajectoryPoint& point) {
  if (unit == StampUnit::kUnknown) unit = stampUnit(csv);
  const bool good = unit == StampUnit::kSeconds ? parseSeconds(csv.field(0), point.stamp)
                                                : parseNanoseconds(csv.field(0), point.stamp);
  if (!good || unit == StampUnit::kUnknown) {
    csv.reject("timestamp", quoteInput(csv.field(0)) + " is not a plain decimal stamp");
    return false;
  }
  std::array<double, 7> v{};
  if (!csv.numbers(1, kTumNames, v.data())) return false;
  return setPose(csv, {v[0], v[1], v[2]}, {v[6], v[3], v[4], v[5]}, point);
}

bool readCsvRow(CsvReader& csv, TrajectoryPoint& point) {
  if (!parseCsvStamp(csv.field(0), point.stamp)) {
    csv.reject("timestamp", quoteInput(csv.field(0)) + " is not a stamp in ns");
    return false;
  }
  std::array<double, 7> v{};
  if (!csv.numbers(1, kCsvNames, v.data())) return false;
  if (!setPose(csv, {v[0], v[1], v[2]}, {v[3], v[4], v[5], v[6]}, point)) return false;
  if (csv.size() < kMotionColumns) return true;
  std::array<double, 9> m{};
  if (!csv.numbers(8, kMotionNames, m.data())) return false;
  point.v_world_body = {m[0], m[1], m[2]};
  point.bias_gyro = {m[3], m[4], m[5]};
  point.bias_accel = {m[6], m[7], m[8]};
  point.has_motion = true;
  return true;
}

Trajectory readRows(CsvReader& csv, bool is_csv, LogCounters& counters, LogWarnings& warnings) {
  Trajectory trajectory;
  StampUnit unit = StampUnit::kUnknown;
  while (csv.next(8)) {
    TrajectoryPoint point;
    if (is_csv ? readCsvRow(csv, point) : readTumRow(csv, unit, point)) trajectory.push_back(point);
  }
  csv.finish("poses",
             "Write each row as `t tx ty tz qx qy qz qw` (TUM) or `ns, p xyz, q wxyz` (EuRoC csv); a file of "
             "positions only can be used with `swiftlet evaluate --truth`");
  orderByStamp(trajectory, csv.name(), counters, warnings);
  return trajectory;
}

}  // namespace

Trajectory readTrajectory(const std::string& path, LogCounters& counters, LogWarnings& warnings) {
  const CsvReader::Separator separator = CsvReader::separatorOf(path);
  CsvReader csv(path, separator, counters, warnings);
  return readRows(csv, separator == CsvReader::Separator::kComma, counters, warnings);
}

Trajectory readWholeTrajectory(const std::string& path, const std::string& remedy) {
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::Separator::kBlank, counters, warnings);
  Trajectory trajectory;
  StampUnit unit = StampUnit::kUnknown;
  while (csv.next(8)) {
    TrajectoryPoint point;
    if (!readTumRow(csv, unit, point)) break;
    if (!trajectory.empty() && point.stamp <= trajectory.back().stamp) {
      throw csv.error("timestamp", "is not later than the previous one", remedy);
    }
    trajectory.push_back(point);
  }
  if (csv.firstBad()) {
    const InputError& bad = *csv.firstBad();
    throw InputError(bad.file, bad.line, bad.field, bad.message, remedy);
  }
  if (trajectory.empty()) throw InputError(path, 0, "", "holds no poses", remedy);
  return trajectory;
}

Trajectory readTrajectoryText(const std::string& name, std::string_view text, LogCounters& counters,
                              LogWarnings& warnings) {
  const CsvReader::Separator separator = CsvReader::separatorOfText(text);
  CsvReader csv(name, text, separator, counters, warnings);
  return readRows(csv, separator == CsvReader::Separator::kComma, counters, warnings);
}

Trajectory onImageClock(Trajectory poses, Duration camera_to_imu_shift) {
  for (TrajectoryPoint& point : poses) point.stamp = point.stamp - camera_to_imu_shift;
  return poses;
}

std::string formatSeconds(Stamp stamp) {
  const bool negative = stamp.ns < 0;
  const auto ns = static_cast<std::uint64_t>(stamp.ns);
  const std::uint64_t magnitude = negative ? 0 - ns : ns;
  constexpr std::uint64_t kSecond = kNsPerSecond;
  return fmt::format("{}{}.{:09}", negative ? "-" : "", magnitude / kSecond, magnitude % kSecond);
}

std::string formatTum(Stamp stamp, const SE3& T_world_body) {
  const Eigen::Vector3d& p = T_world_body.translation;
  Eigen::Quaterniond q = T_world_body.rotation;
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", formatSeconds(stamp), p.x(),
                     p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
}

TumWriter::TumWriter(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
  if (file_ == nullptr) {
    throw InputError(path, 0, "", std::string("cannot be written: ") + std::strerror(errno), "");
  }
}

TumWriter::~TumWriter() {
  if (file_ != nullptr) std::fclose(file_);
}

void TumWriter::write(Stamp stamp, const SE3& T_world_body) {
  const std::string line = formatTum(stamp, T_world_body) + "\n";
  if (std::fwrite(line.data(), 1, line.size(), file_) != line.size()) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Check that the disk is not full");
  }
}

void TumWriter::close() {
  std::FILE* file = file_;
  file_ = nullptr;
  if (file != nullptr && std::fclose(file) != 0) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Check that the disk is not full");
  }
}

}  // namespace swiftlet
