#include "firmware_host/lab/calibrate/imu_noise/imu_source.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/message_coder.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/input/unpack_xz.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/bag_topics.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/join_imu.hpp"
#include "drivers/recorded/open_log.hpp"

namespace swiftlet {
namespace {

using Take = std::function<void(const ImuSample&)>;

void readRows(CsvReader& csv, LogWarnings& warnings, const Take& take) {
  ImuRows rows(csv, warnings);
  ImuSample sample;
  while (rows.next(sample)) take(sample);
}

void readText(const std::string& name, const std::string& text, LogWarnings& warnings, const Take& take) {
  LogCounters counters;
  CsvReader csv(name, text, CsvReader::Separator::kComma, counters, warnings);
  readRows(csv, warnings, take);
}

void readFile(const std::string& path, LogWarnings& warnings, const Take& take) {
  if (path.ends_with(".xz")) {
    std::ifstream file(path, std::ios::binary);
    const std::string packed(std::istreambuf_iterator<char>(file), {});
    return readText(path, unpackXz(path, packed, FileTree::kMostText), warnings, take);
  }
  LogCounters counters;
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  readRows(csv, warnings, take);
}

std::vector<ImuSample> ofTopic(BagFile& bag, std::uint32_t topic, LogWarnings& warnings) {
  std::vector<ImuSample> samples;
  std::uint64_t bad = 0;
  for (const BagEntry& entry : bag.entries()) {
    rosmsg::Imu imu;
    if (entry.topic != topic) continue;
    if (!decode(bag.read(entry), bag.topics()[topic].encoding, imu)) {
      ++bad;
      continue;
    }
    ImuSample sample;
    sample.stamp = imu.header.stamp.ns == 0 ? entry.log_time : imu.header.stamp;
    sample.gyro = {imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z};
    sample.accel = {imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z};
    const bool finite = sample.gyro.allFinite() && sample.accel.allFinite();
    bad += finite ? 0 : 1;
    if (finite) samples.push_back(sample);
  }
  if (bad > 0) {
    warnings.add(fmt::format("{}: {}: {} messages are damaged or not finite, skipped", bag.path(),
                             bag.topics()[topic].name, bad));
  }
  return samples;
}

void readBag(const std::string& path, LogWarnings& warnings, const Take& take) {
  const std::unique_ptr<BagFile> bag = openBag(path);
  for (const std::string& line : bag->warnings()) warnings.add(line);
  const BagImuTopics topics = chooseImuTopics(*bag, "", warnings);
  LogCounters counters;
  std::vector<ImuSample> samples = ofTopic(*bag, topics.gyro, warnings);
  orderSamples(samples, path, counters, warnings);
  if (topics.accel) {
    std::vector<ImuSample> accel = ofTopic(*bag, *topics.accel, warnings);
    orderSamples(accel, path, counters, warnings);
    std::uint64_t left_out = 0;
    samples = joinImu(samples, accel, left_out);
    warnings.add(path +
                 ": gyroscope and accelerometer have separate topics. The accelerometer is interpolated, "
                 "which lowers its white noise by up to a third: give a log with a single IMU topic");
  }
  for (const ImuSample& sample : samples) take(sample);
}

void readRecording(const std::string& path, LogWarnings& warnings, const Take& take) {
  LogOptions options;
  options.without_images = true;
  options.imu_after_last_image = true;
  const std::unique_ptr<LogSource> log = openLog(path, options);
  SensorMessage message;
  while (log->next(message)) {
    if (const auto* sample = std::get_if<ImuSample>(&message)) take(*sample);
  }
  for (const std::string& line : log->warnings()) warnings.add(line);
}

}  // namespace

void eachImuSample(const std::string& log, const std::function<void(const ImuSample&)>& take,
                   std::vector<std::string>& warnings) {
  if (!std::filesystem::exists(log)) {
    throw InputError(log, 0, "", "does not exist",
                     "Give a log with an IMU: a EuRoC folder, an imu0/data.csv, a bag or a recording");
  }
  LogWarnings lines;
  std::optional<Stamp> last;
  std::uint64_t late = 0;
  const Take rising = [&](const ImuSample& sample) {
    if (last && sample.stamp <= *last) {
      ++late;
      return;
    }
    last = sample.stamp;
    take(sample);
  };
  const bool file = std::filesystem::is_regular_file(log);
  if (file && (log.ends_with(".csv") || log.ends_with(".xz") || log.ends_with(".txt"))) {
    readFile(log, lines, rising);
  } else if (isAslFolder(log)) {
    const AslFiles files = findAslFiles(log);
    readFile(files.tree->name(files.at("imu0/data.csv")), lines, rising);
  } else if (file && isArchive(log)) {
    const AslFiles files = findAslFiles(log);
    readText(log, files.tree->text(files.at("imu0/data.csv")), lines, rising);
  } else if (isBag(log)) {
    readBag(log, lines, rising);
  } else {
    readRecording(log, lines, rising);
  }
  if (late > 0)
    lines.add(fmt::format("{}: {} samples are not later than the previous one and are dropped", log, late));
  warnings.insert(warnings.end(), lines.lines().begin(), lines.lines().end());
}

}  // namespace swiftlet
