#include "firmware_host/lab/import/motion_of_video.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/join_imu.hpp"
#include "firmware_host/lab/import/gpmf.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::json;

constexpr const char* kPhoneRemedy =
    "A line is {\"time\": s, \"sensor\": {\"type\": \"gyroscope\", \"values\": [x, y, z]}}";

/// Times of samples from sample counts at known times.
///
/// The rate is the slope of the least-squares line. Counts grow in steps, because samples come in batches, so
/// that line is late by half a batch on average. No sample is counted before it was measured, so the line is
/// moved until it reaches each count no later than the count's time.
class CountLine {
 public:
  void add(double count, double seconds) { points_.emplace_back(count, seconds); }
  /// False: too few counts for a line.
  bool fit() {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& point : points_) mean += point / static_cast<double>(points_.size());
    Eigen::Vector2d sums = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& point : points_) sums += (point.x() - mean.x()) * (point - mean);
    if (!(sums.x() > 0)) return false;
    period_ = sums.y() / sums.x();
    begin_ = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& point : points_) begin_ = std::min(begin_, point.y() - period_ * point.x());
    return period_ > 0;
  }
  /// Time of the sample with this number [s].
  [[nodiscard]] double at(double number) const { return begin_ + period_ * number; }

 private:
  std::vector<Eigen::Vector2d> points_;  ///< count, s
  double period_ = 0;
  double begin_ = 0;
};

/// Sample of one sensor: the value is used for both gyro and accelerometer.
ImuSample both(Stamp stamp, const Eigen::Vector3d& value) {
  ImuSample sample;
  sample.stamp = stamp;
  sample.gyro = value;
  sample.accel = value;
  return sample;
}

std::vector<ImuSample> dated(const std::string& name, const std::vector<MetadataPacket>& packets,
                             const std::vector<GpmfPayload>& payloads, GpmfChannel GpmfPayload::*which,
                             const char* what, Stamp zero) {
  CountLine line;
  std::vector<std::pair<double, Eigen::Vector3d>> counted;
  double count = 0;
  for (std::size_t i = 0; i < payloads.size(); ++i) {
    const GpmfChannel& channel = payloads[i].*which;
    // If the file was cut from a longer recording, counts continue from the payload before the file's first.
    if (channel.counted) count = std::max(count, static_cast<double>(channel.before));
    line.add(count, packets[i].begin.seconds());
    for (const Eigen::Vector3d& value : channel.values) counted.emplace_back(count++, value);
    // The last of several payloads is shorter than stated: the recording ended within it.
    if (payloads.size() == 1) line.add(count, (packets[i].begin + packets[i].length).seconds());
  }
  if (counted.empty() || !line.fit()) {
    throw InputError(name, 0, "", fmt::format("its metadata contains no {}", what),
                     "Give the IMU's samples in a csv file: `swiftlet import VIDEO IMU.csv`");
  }
  std::vector<ImuSample> samples;
  for (const auto& [n, value] : counted)
    samples.push_back(both(zero + Duration::fromSeconds(line.at(n)), value));
  return samples;
}

/// Empty if the time does not fit a stamp.
std::optional<Stamp> stampOf(const Json& json) {
  constexpr double kLatest = 9e9;  // s
  const double time = json.at("time").get<double>();
  if (!(std::abs(time) < kLatest)) return std::nullopt;
  return Stamp{Duration::fromSeconds(time).ns};
}

}  // namespace

std::vector<ImuSample> goproImu(const std::string& name, const std::vector<MetadataPacket>& packets,
                                Stamp zero) {
  std::vector<GpmfPayload> payloads;
  for (const MetadataPacket& packet : packets) {
    std::optional<GpmfPayload> payload = readGpmf(packet.bytes);
    if (!payload) {
      throw InputError(name, 0, fmt::format("metadata at {:.3f} s", packet.begin.seconds()),
                       "is damaged or not GPMF", "Copy the file from the camera again");
    }
    payloads.push_back(std::move(*payload));
  }
  std::uint64_t left_out = 0;
  return joinImu(dated(name, packets, payloads, &GpmfPayload::gyro, "gyro", zero),
                 dated(name, packets, payloads, &GpmfPayload::accel, "accelerometer", zero), left_out);
}

PhoneLog readPhoneLog(const std::string& name, std::string_view text) {
  PhoneLog log;
  std::vector<ImuSample> gyro;
  std::vector<ImuSample> accel;
  int line = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view row = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line;
    if (row.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    try {
      const Json json = Json::parse(row);
      if (json.contains("sensor")) {
        const Json& sensor = json.at("sensor");
        const std::string type = sensor.at("type").get<std::string>();
        if (type != "gyroscope" && type != "accelerometer") continue;
        const auto values = sensor.at("values").get<std::array<double, 3>>();
        const std::optional<Stamp> stamp = stampOf(json);
        if (!stamp) throw InputError(name, line, "time", "is not a time in seconds", kPhoneRemedy);
        (type == "gyroscope" ? gyro : accel).push_back(both(*stamp, {values[0], values[1], values[2]}));
      } else if (json.contains("frames")) {
        for (const Json& frame : json.at("frames")) {
          const std::size_t camera = frame.value("cameraInd", std::size_t{0});
          const std::optional<Stamp> stamp = stampOf(frame.contains("time") ? frame : json);
          if (!stamp) throw InputError(name, line, "time", "is not a time in seconds", kPhoneRemedy);
          if (camera < kMaxCameras) log.images[camera].push_back(*stamp);
        }
      }
    } catch (const Json::exception& error) {
      throw InputError(name, line, "", std::string("is not a line of a phone log: ") + error.what(),
                       kPhoneRemedy);
    }
  }
  // Phones write the samples of each sensor in bursts.
  std::ranges::stable_sort(gyro, {}, &ImuSample::stamp);
  std::ranges::stable_sort(accel, {}, &ImuSample::stamp);
  std::uint64_t left_out = 0;
  log.samples = joinImu(gyro, accel, left_out);
  if (log.samples.empty()) {
    throw InputError(name, 0, "", "holds no pair of gyroscope and accelerometer",
                     "Record both; lines are {\"time\": s, \"sensor\": {...}}");
  }
  return log;
}

}  // namespace swiftlet
