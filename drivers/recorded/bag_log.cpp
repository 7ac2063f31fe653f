#include "drivers/recorded/bag_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/message_coder.hpp"
#include "drivers/recorded/bag_topics.hpp"
#include "drivers/recorded/grey_copier.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/join_imu.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/recorded_log.hpp"

namespace swiftlet {
namespace {

class BagLog final : public RecordedLog {
 public:
  BagLog(const std::string& path, const LogOptions& options);
  [[nodiscard]] Trajectory groundTruth(LogWarnings& warnings) const override {
    return readBagTruth(*bag_, truth_, warnings);
  }
  [[nodiscard]] std::string groundTruthName() const override {
    return truth_ ? bag_->path() + " " + bag_->topics()[*truth_].name : std::string();
  }
  [[nodiscard]] std::span<const std::uint8_t> picture() const override { return picture_; }

 protected:
  Fetched fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) override;

 private:
  void chooseTopics();
  void scan();
  void addImu(const BagEntry& entry, std::vector<ImuSample>& samples);
  void addImage(std::size_t camera, std::size_t entry);
  void joinTopics();
  /// Checks the range; a stamp of zero is replaced by the receive time.
  void checkStamp(const BagEntry& entry, Stamp& stamp);
  void countShort(const BagEntry& entry);
  [[nodiscard]] const BagTopic& topic(std::uint32_t index) const { return bag_->topics()[index]; }

  std::unique_ptr<BagFile> bag_;
  BagImuTopics imu_;
  std::array<std::optional<std::uint32_t>, kMaxCameras> camera_;
  std::optional<std::uint32_t> truth_;
  std::array<std::vector<std::size_t>, kMaxCameras> pictures_;  ///< entries of the bag
  std::vector<ImuSample> accel_;                                ///< if the accelerometer has its own topic
  std::uint64_t zero_stamps_ = 0;
  std::span<const std::uint8_t> picture_;
  ImageDecoder decoder_;
  GreyCopier raw_;
};

BagLog::BagLog(const std::string& path, const LogOptions& options) : RecordedLog(options) {
  if (options_.uncalibrated) {
    calibration_.rig.camera_count = kMaxCameras;
  } else if (options_.calibration.empty()) {
    throw InputError(path, 0, "", "a bag contains no calibration",
                     "Give the Kalibr or EuRoC calibration to use");
  } else {
    calibration_ =
        readCalibration(options_.calibration, options_.imu_calibration, options_.calibration_options);
  }
  if (options_.mono) calibration_.rig.camera_count = 1;
  bag_ = openBag(path);
  for (const std::string& line : bag_->warnings()) warnings_.add(line);
  chooseTopics();
  scan();
  prepare(path + " " + topic(imu_.gyro).name);
}

void BagLog::chooseTopics() {
  imu_ = chooseImuTopics(*bag_, calibration_.imu_topic, warnings_);
  truth_ = chooseTruthTopic(*bag_);
  if (truth_) {
    warnings_.add(fmt::format("{}: truth from {}, whose body frame is assumed to be the IMU", bag_->path(),
                              topic(*truth_).name));
  }
  if (options_.without_images) return;
  camera_ = chooseImageTopics(*bag_, calibration_, warnings_);
  if (calibration_.rig.camera_count > 1 && !camera_[1]) {
    warnings_.add(bag_->path() + ": only one image topic, continuing with one camera");
    calibration_.rig.camera_count = 1;
  }
}

void BagLog::checkStamp(const BagEntry& entry, Stamp& stamp) {
  bag_->checkStamp(entry.topic, stamp);
  if (stamp.ns != 0) return;
  stamp = entry.log_time;
  if (++zero_stamps_ == 1) {
    warnings_.add(bag_->path() + ": " + topic(entry.topic).name +
                  " has messages without a stamp; their receive time is used");
  }
}

void BagLog::countShort(const BagEntry& entry) {
  warnings_.addCounted(
      ++counters_.bad_rows,
      fmt::format("{}: {}: the message received at {} is not a complete {}, skipped", bag_->path(),
                  topic(entry.topic).name, entry.log_time.ns, topic(entry.topic).type));
}

void BagLog::addImu(const BagEntry& entry, std::vector<ImuSample>& samples) {
  rosmsg::Imu imu;
  if (!decode(bag_->read(entry), topic(entry.topic).encoding, imu)) return countShort(entry);
  ImuSample sample;
  sample.stamp = imu.header.stamp;
  sample.gyro = {imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z};
  sample.accel = {imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z};
  checkStamp(entry, sample.stamp);
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    warnings_.addCounted(++counters_.nan_rows, fmt::format("{}: {}: not finite at {}, skipped", bag_->path(),
                                                           topic(entry.topic).name, sample.stamp.ns));
    return;
  }
  samples.push_back(sample);
}

void BagLog::addImage(std::size_t camera, std::size_t index) {
  const BagEntry& entry = bag_->entries()[index];
  rosmsg::Header header;
  if (!decode(bag_->read(entry), topic(entry.topic).encoding, header)) return countShort(entry);
  checkStamp(entry, header.stamp);
  images_.push_back({header.stamp, static_cast<std::uint32_t>(camera),
                     static_cast<std::uint32_t>(pictures_[camera].size())});
  pictures_[camera].push_back(index);
}

void BagLog::scan() {
  std::array<std::vector<ImageEntry>, kMaxCameras> ordered;
  const std::vector<BagEntry>& entries = bag_->entries();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].topic == imu_.gyro) addImu(entries[i], samples_);
    if (imu_.accel && entries[i].topic == *imu_.accel) addImu(entries[i], accel_);
    for (std::size_t c = 0; c < calibration_.rig.camera_count; ++c) {
      if (camera_[c] && entries[i].topic == *camera_[c]) addImage(c, i);
    }
  }
  const std::string name = bag_->path() + " " + topic(imu_.gyro).name;
  if (samples_.empty())
    throw InputError(name, 0, "", "no usable IMU message", "Check that the bag is complete");
  orderSamples(samples_, name, counters_, warnings_);
  if (imu_.accel) joinTopics();
  checkUnits(samples_, name, warnings_);
  for (const ImageEntry& image : images_) ordered[image.camera].push_back(image);
  images_.clear();
  for (std::size_t c = 0; c < calibration_.rig.camera_count; ++c) {
    if (!camera_[c]) continue;
    orderByStamp(ordered[c], bag_->path() + " " + topic(*camera_[c]).name, counters_, warnings_);
    images_.insert(images_.end(), ordered[c].begin(), ordered[c].end());
  }
}

void BagLog::joinTopics() {
  const std::string name = bag_->path() + " " + topic(*imu_.accel).name;
  orderSamples(accel_, name, counters_, warnings_);
  std::uint64_t left_out = 0;
  samples_ = joinImu(samples_, accel_, left_out);
  warnings_.add(
      fmt::format("{}: the accelerometer is in {}; it is interpolated to the gyroscope's stamps, and {} of "
                  "its samples have no neighbour on one side",
                  bag_->path(), topic(*imu_.accel).name, left_out));
  if (samples_.empty()) {
    throw InputError(name, 0, "timestamp", "no gyroscope sample lies between two accelerometer samples",
                     "Both need stamps of one clock");
  }
  accel_ = {};
}

RecordedLog::Fetched BagLog::fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) {
  const BagEntry& message = bag_->entries()[pictures_[entry.camera][entry.index]];
  const BagTopic& from = topic(message.topic);
  Fetched fetched;
  fetched.name = fmt::format("{}: {} at {}", bag_->path(), from.name, entry.stamp.ns);
  picture_ = {};
  const std::span<const std::uint8_t> body = bag_->read(message);
  if (from.type == rosmsg::CompressedImage::kType) {
    rosmsg::CompressedImage image;
    if (!decode(body, from.encoding, image)) return fetched;
    picture_ = image.data;
    fetched.result = decoder_.decode(image.data, expected, out, fetched.found);
  } else {
    rosmsg::Image image;
    if (!decode(body, from.encoding, image)) return fetched;
    fetched.result = raw_.copy(image, expected, out, fetched.found);
  }
  return fetched;
}

}  // namespace

std::unique_ptr<LogSource> openBagLog(const std::string& path, const LogOptions& options) {
  return std::make_unique<BagLog>(path, options);
}

}  // namespace swiftlet
