#include "drivers/recorded/ros_bag.hpp"

#include <fmt/format.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <array>
#include <map>

#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/recorded_log.hpp"
#include "drivers/recorded/ros_messages.hpp"

namespace swiftlet {
namespace {

constexpr const char* kImuType = "sensor_msgs/Imu";
constexpr const char* kImageType = "sensor_msgs/Image";
constexpr const char* kCompressedType = "sensor_msgs/CompressedImage";

class RosBag final : public RecordedLog {
 public:
  RosBag(const std::string& path, const LogOptions& options);

 protected:
  Fetched fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) override;

 private:
  struct Picture {
    Stamp stamp;
    rosbag::MessageInstance message;
    bool compressed = false;
  };

  void chooseTopics();
  void scan();
  void addImu(const rosbag::MessageInstance& message);
  void addImage(std::size_t camera, const rosbag::MessageInstance& message);
  std::span<const std::uint8_t> bodyOf(const rosbag::MessageInstance& message);
  void repairZeroStamp(const rosbag::MessageInstance& message, Stamp& stamp);

  std::string path_;
  rosbag::Bag bag_;
  std::unique_ptr<rosbag::View> view_;
  std::string imu_topic_;
  std::array<std::string, kMaxCameras> camera_topic_;
  std::array<std::vector<Picture>, kMaxCameras> pictures_;
  std::vector<std::uint8_t> body_;
  std::uint64_t zero_stamps_ = 0;
  ImageDecoder decoder_;
  GreyCopier raw_;
};

RosBag::RosBag(const std::string& path, const LogOptions& options) : RecordedLog(options), path_(path) {
  if (options_.calibration.empty()) {
    throw InputError(path, 0, "", "a bag holds no calibration",
                     "Name the Kalibr or EuRoC calibration to use");
  }
  calibration_ =
      readCalibration(options_.calibration, options_.imu_calibration, options_.calibration_options);
  if (options_.mono) calibration_.rig.camera_count = 1;
  bag_.open(path, rosbag::bagmode::Read);
  chooseTopics();
  scan();
  prepare(path + " " + imu_topic_);
}

/// Topics by type, with their message counts.
void RosBag::chooseTopics() {
  rosbag::View everything(bag_);
  std::map<std::string, std::string> type_of;
  for (const rosbag::ConnectionInfo* connection : everything.getConnections()) {
    type_of[connection->topic] = connection->datatype;
  }
  std::uint32_t most = 0;
  std::vector<std::string> images;
  for (const auto& [topic, type] : type_of) {
    if (type == kImageType || type == kCompressedType) images.push_back(topic);
    if (type != kImuType) continue;
    const std::uint32_t count = rosbag::View(bag_, rosbag::TopicQuery(topic)).size();
    const bool named_found = !imu_topic_.empty() && imu_topic_ == calibration_.imu_topic;
    if (topic == calibration_.imu_topic || (!named_found && count > most)) {
      imu_topic_ = topic;
      most = count;
    }
  }
  if (imu_topic_.empty())
    throw InputError(path_, 0, "", "no topic of type sensor_msgs/Imu", "Record the IMU too");
  if (options_.without_images) return;
  // A raw topic and its compressed twin carry the same pictures.
  std::erase_if(images, [&](const std::string& topic) {
    const std::size_t tail = topic.rfind("/compressed");
    return tail != std::string::npos && type_of.contains(topic.substr(0, tail));
  });
  const auto& wanted = calibration_.camera_topic;
  std::size_t next = 0;
  for (std::size_t camera = 0; camera < calibration_.rig.camera_count; ++camera) {
    for (const std::string& candidate : {wanted[camera], wanted[camera] + "/compressed"}) {
      if (camera_topic_[camera].empty() && type_of.contains(candidate)) camera_topic_[camera] = candidate;
    }
  }
  for (std::size_t camera = 0; camera < calibration_.rig.camera_count; ++camera) {
    while (camera_topic_[camera].empty() && next < images.size()) {
      const std::string& topic = images[next++];
      if (std::find(camera_topic_.begin(), camera_topic_.end(), topic) == camera_topic_.end()) {
        camera_topic_[camera] = topic;
      }
    }
  }
  if (camera_topic_[0].empty()) {
    throw InputError(path_, 0, "", "no topic of type sensor_msgs/Image or CompressedImage",
                     "Record the cameras too");
  }
  if (calibration_.rig.camera_count > 1 && camera_topic_[1].empty()) {
    warnings_.add(path_ + ": one image topic only, going on with one camera");
    calibration_.rig.camera_count = 1;
  }
}

std::span<const std::uint8_t> RosBag::bodyOf(const rosbag::MessageInstance& message) {
  body_.resize(message.size());
  ros::serialization::OStream stream(body_.data(), static_cast<std::uint32_t>(body_.size()));
  message.write(stream);
  return body_;
}

void RosBag::repairZeroStamp(const rosbag::MessageInstance& message, Stamp& stamp) {
  if (stamp.ns != 0) return;
  stamp.ns = static_cast<std::int64_t>(message.getTime().toNSec());
  if (++zero_stamps_ == 1) {
    warnings_.add(path_ + ": " + message.getTopic() +
                  " has messages without a stamp; their receive time is used");
  }
}

void RosBag::addImu(const rosbag::MessageInstance& message) {
  ImuSample sample;
  if (!readRosImu(bodyOf(message), sample)) {
    warnings_.addCounted(++counters_.bad_rows, path_ + ": " + imu_topic_ + ": a message ends early, skipped");
    return;
  }
  repairZeroStamp(message, sample.stamp);
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    warnings_.addCounted(++counters_.nan_rows, fmt::format("{}: {}: not finite at {}, skipped", path_,
                                                           imu_topic_, sample.stamp.ns));
    return;
  }
  samples_.push_back(sample);
}

void RosBag::addImage(std::size_t camera, const rosbag::MessageInstance& message) {
  Stamp stamp;
  if (!readRosStamp(bodyOf(message), stamp)) {
    warnings_.addCounted(++counters_.bad_rows,
                         path_ + ": " + camera_topic_[camera] + ": a message ends early, skipped");
    return;
  }
  repairZeroStamp(message, stamp);
  pictures_[camera].push_back({stamp, message, message.getDataType() == kCompressedType});
}

void RosBag::scan() {
  std::vector<std::string> topics = {imu_topic_};
  for (const std::string& topic : camera_topic_) {
    if (!topic.empty()) topics.push_back(topic);
  }
  view_ = std::make_unique<rosbag::View>(bag_, rosbag::TopicQuery(topics));
  for (const rosbag::MessageInstance& message : *view_) {
    const std::string& topic = message.getTopic();
    if (topic == imu_topic_) addImu(message);
    for (std::size_t c = 0; c < calibration_.rig.camera_count; ++c) {
      if (topic == camera_topic_[c]) addImage(c, message);
    }
  }
  if (samples_.empty()) throw InputError(path_, 0, imu_topic_, "no usable IMU message", "Is the bag whole?");
  orderSamples(samples_, path_ + " " + imu_topic_, counters_, warnings_);
  checkUnits(samples_, path_ + " " + imu_topic_, warnings_);
  for (std::size_t c = 0; c < calibration_.rig.camera_count; ++c) {
    // MessageInstance cannot be assigned, so an index is sorted in its place.
    std::vector<ImageEntry> entries;
    for (std::size_t i = 0; i < pictures_[c].size(); ++i) {
      entries.push_back(
          {pictures_[c][i].stamp, static_cast<std::uint32_t>(c), static_cast<std::uint32_t>(i)});
    }
    orderByStamp(entries, path_ + " " + camera_topic_[c], counters_, warnings_);
    images_.insert(images_.end(), entries.begin(), entries.end());
  }
}

RecordedLog::Fetched RosBag::fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) {
  Fetched fetched;
  fetched.name = fmt::format("{}: {} at {}", path_, camera_topic_[entry.camera], entry.stamp.ns);
  const Picture& picture = pictures_[entry.camera][entry.index];
  RosImage image;
  try {
    const std::span<const std::uint8_t> body = bodyOf(picture.message);
    const bool good = picture.compressed ? readRosCompressedImage(body, image) : readRosImage(body, image);
    if (!good) return fetched;
  } catch (const rosbag::BagException&) {
    return fetched;
  }
  if (picture.compressed) {
    fetched.result = decoder_.decode(image.data, expected, out, fetched.found);
  } else {
    fetched.found = image.size;
    fetched.result = raw_.copy(image, expected, out);
  }
  return fetched;
}

}  // namespace

std::unique_ptr<LogSource> openRosBag(const std::string& path, const LogOptions& options) {
  try {
    return std::make_unique<RosBag>(path, options);
  } catch (const rosbag::BagException& error) {
    throw InputError(path, 0, "", std::string("not a readable bag (") + error.what() + ")",
                     "`rosbag reindex` repairs a bag whose recording was cut");
  }
}

}  // namespace swiftlet
