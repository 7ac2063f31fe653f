#include "drivers/recorded/bag_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "drivers/bag/message_coder.hpp"
#include "drivers/bag/ros_messages.hpp"
#include "drivers/image/jpeg_grey.hpp"
#include "drivers/recorded/order_by_stamp.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kProbed = 50;  // messages per topic; a working sensor is not zero for so long

bool isRead(const BagTopic& topic) { return topic.messages > 0 && topic.encoding != BagEncoding::kOther; }

struct Halves {
  std::size_t probed = 0;
  bool gyro = false;
  bool accel = false;
};

bool isZero(const rosmsg::Vector3& v) { return v.x == 0 && v.y == 0 && v.z == 0; }

std::map<std::uint32_t, Halves> probeImu(BagFile& bag) {
  std::map<std::uint32_t, Halves> halves;
  for (std::uint32_t i = 0; i < bag.topics().size(); ++i) {
    if (bag.topics()[i].type == rosmsg::Imu::kType && isRead(bag.topics()[i])) halves[i] = {};
  }
  std::size_t open = halves.size();
  for (std::size_t i = 0; i < bag.entries().size() && open > 0; ++i) {
    const BagEntry& entry = bag.entries()[i];
    const auto found = halves.find(entry.topic);
    if (found == halves.end() || found->second.probed == kProbed) continue;
    Halves& half = found->second;
    rosmsg::Imu imu;
    if (!decode(bag.read(entry), bag.topics()[entry.topic].encoding, imu)) continue;
    half.gyro = half.gyro || !isZero(imu.angular_velocity);
    half.accel = half.accel || !isZero(imu.linear_acceleration);
    if (++half.probed == kProbed) --open;
  }
  return halves;
}

/// The `wanted` topic if it has these parts, else the topic with the most messages that has them.
std::optional<std::uint32_t> busiest(const BagFile& bag, const std::map<std::uint32_t, Halves>& halves,
                                     const std::string& wanted, bool gyro, bool accel) {
  std::optional<std::uint32_t> best;
  for (const auto& [index, half] : halves) {
    const BagTopic& topic = bag.topics()[index];
    if (half.gyro != gyro || half.accel != accel) continue;
    if (topic.name == wanted) return index;
    if (!best || topic.messages > bag.topics()[*best].messages) best = index;
  }
  return best;
}

/// Size of the first image on a topic; {0, 0} for a compressed one.
ImageSize sizeOn(BagFile& bag, std::uint32_t topic) {
  rosmsg::Image image;
  if (bag.topics()[topic].type != rosmsg::Image::kType) return {};
  const auto first = std::find_if(bag.entries().begin(), bag.entries().end(),
                                  [topic](const BagEntry& entry) { return entry.topic == topic; });
  if (first == bag.entries().end() || !decode(bag.read(*first), bag.topics()[topic].encoding, image))
    return {};
  if (image.width > kMaxImageSide || image.height > kMaxImageSide) return {};
  return {static_cast<int>(image.width), static_cast<int>(image.height)};
}

/// Image topics sorted by name, without depth images and without compressed copies of raw topics.
std::vector<std::uint32_t> imageTopics(const BagFile& bag) {
  constexpr std::string_view kTail = "/compressed";
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    const bool raw = topic.type == rosmsg::Image::kType;
    if (!isRead(topic) || (!raw && topic.type != rosmsg::CompressedImage::kType)) continue;
    if (topic.name.find("epth") != std::string::npos) continue;  // depth, compressedDepth
    const bool twin = topic.name.ends_with(kTail) &&
                      std::any_of(bag.topics().begin(), bag.topics().end(), [&](const BagTopic& other) {
                        return isRead(other) && other.type == rosmsg::Image::kType &&
                               other.name + std::string(kTail) == topic.name;
                      });
    if (!twin) found.push_back(i);
  }
  std::sort(found.begin(), found.end(),
            [&bag](std::uint32_t a, std::uint32_t b) { return bag.topics()[a].name < bag.topics()[b].name; });
  return found;
}

std::optional<std::uint32_t> namedImages(const BagFile& bag, const std::string& name) {
  for (const std::string& wanted : {name, name + "/compressed"}) {
    for (std::uint32_t i = 0; i < bag.topics().size() && !name.empty(); ++i) {
      const BagTopic& topic = bag.topics()[i];
      const bool image = topic.type == rosmsg::Image::kType || topic.type == rosmsg::CompressedImage::kType;
      if (image && isRead(topic) && topic.name == wanted) return i;
    }
  }
  return std::nullopt;
}

/// Reads a message that holds a pose as a point of a trajectory.
bool readPose(const BagTopic& topic, std::span<const std::uint8_t> body, TrajectoryPoint& point) {
  const auto take = [&point](const rosmsg::Header& header, const auto& p, const rosmsg::Quaternion& q) {
    const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
    constexpr double kFarFromUnit = 1e-3;
    if (!(std::abs(rotation.norm() - 1) <= kFarFromUnit)) return false;
    point.stamp = header.stamp;
    point.T_world_body = SE3(rotation, Eigen::Vector3d(p.x, p.y, p.z));
    // Do not renormalize a unit quaternion: re-exporting a bag must not change its last bits.
    constexpr double kOfUnitNorm = 1e-14;
    if (std::abs(rotation.norm() - 1) < kOfUnitNorm) point.T_world_body.rotation = rotation;
    return point.T_world_body.translation.allFinite();
  };
  if (topic.type == rosmsg::Odometry::kType) {
    rosmsg::Odometry message;
    return decode(body, topic.encoding, message) &&
           take(message.header, message.pose.pose.position, message.pose.pose.orientation);
  }
  if (topic.type == rosmsg::PoseStamped::kType) {
    rosmsg::PoseStamped message;
    return decode(body, topic.encoding, message) &&
           take(message.header, message.pose.position, message.pose.orientation);
  }
  rosmsg::TransformStamped message;
  return decode(body, topic.encoding, message) &&
         take(message.header, message.transform.translation, message.transform.rotation);
}

}  // namespace

BagImuTopics chooseImuTopics(BagFile& bag, const std::string& wanted, LogWarnings& warnings) {
  const std::map<std::uint32_t, Halves> halves = probeImu(bag);
  const auto both = busiest(bag, halves, wanted, true, true);
  const auto gyro = busiest(bag, halves, wanted, true, false);
  const auto accel = busiest(bag, halves, wanted, false, true);
  const bool apart_wanted = gyro && accel && bag.topics()[*gyro].name == wanted;
  if (both && !apart_wanted) return {*both, std::nullopt};
  if (gyro && accel) return {*gyro, accel};
  if (gyro) {
    throw InputError(bag.path(), 0, bag.topics()[*gyro].name, "all accelerations are zero",
                     "Also record the accelerometer's topic");
  }
  const auto silent = accel ? accel : busiest(bag, halves, wanted, false, false);
  if (!silent) {
    throw InputError(bag.path(), 0, "", "no topic of type sensor_msgs/Imu", "Also record the IMU");
  }
  // A simulator at rest also sends zero rates.
  warnings.add(
      fmt::format("{}: {}: the first {} angular rates are exactly zero: is the gyroscope's topic missing?",
                  bag.path(), bag.topics()[*silent].name, halves.at(*silent).probed));
  return {*silent, std::nullopt};
}

std::array<std::optional<std::uint32_t>, kMaxCameras> chooseImageTopics(BagFile& bag,
                                                                        const Calibration& calibration,
                                                                        LogWarnings& warnings) {
  const std::size_t cameras = calibration.rig.camera_count;
  std::array<std::optional<std::uint32_t>, kMaxCameras> chosen;
  for (std::size_t c = 0; c < cameras; ++c) chosen[c] = namedImages(bag, calibration.camera_topic[c]);
  const std::vector<std::uint32_t> images = imageTopics(bag);
  // First topics with the right size; then any size for camera 0, since an error that names both sizes helps
  // more than "not found".
  bool guessed = false;
  for (const bool fitting : {true, false}) {
    for (std::size_t c = 0; c < cameras; ++c) {
      const CameraModel& model = calibration.rig.camera[c];
      for (const std::uint32_t topic : images) {
        if (chosen[c] || std::find(chosen.begin(), chosen.end(), topic) != chosen.end()) continue;
        const ImageSize size = sizeOn(bag, topic);
        const bool any_size = model.width() == 0;
        if (fitting && !any_size && size != ImageSize{} && size != ImageSize{model.width(), model.height()})
          continue;
        if (!fitting && c > 0) continue;
        chosen[c] = topic;
        guessed = true;
      }
    }
  }
  if (!chosen[0]) {
    throw InputError(bag.path(), 0, "", "no topic of type sensor_msgs/Image or CompressedImage",
                     "Also record the cameras");
  }
  if (guessed && images.size() > cameras) {
    std::string text = bag.topics()[*chosen[0]].name;
    if (cameras > 1 && chosen[1]) text += " and " + bag.topics()[*chosen[1]].name;
    warnings.add(
        fmt::format("{}: of {} image topics {} are used; `rostopic` in the calibration selects others",
                    bag.path(), images.size(), text));
  }
  return chosen;
}

std::optional<std::uint32_t> chooseTruthTopic(const BagFile& bag) {
  for (std::uint32_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    const bool pose = topic.type == rosmsg::Odometry::kType || topic.type == rosmsg::PoseStamped::kType ||
                      topic.type == rosmsg::TransformStamped::kType;
    if (!pose || !isRead(topic)) continue;
    const std::string name = topic.name + "/";
    for (const char* word : {"truth", "/gt/", "/gt_", "vicon", "mocap"}) {
      if (name.find(word) != std::string::npos) return i;
    }
  }
  return std::nullopt;
}

Trajectory readBagTruth(BagFile& bag, std::optional<std::uint32_t> topic, LogWarnings& warnings) {
  Trajectory truth;
  if (!topic) return truth;
  const std::string name = bag.path() + " " + bag.topics()[*topic].name;
  LogCounters counters;
  for (const BagEntry& entry : bag.entries()) {
    if (entry.topic != *topic) continue;
    TrajectoryPoint point;
    if (readPose(bag.topics()[*topic], bag.read(entry), point)) {
      bag.checkStamp(*topic, point.stamp);
      truth.push_back(point);
    } else {
      warnings.addCounted(
          ++counters.bad_rows,
          fmt::format("{}: the message received at {} is not a pose, skipped", name, entry.log_time.ns));
    }
  }
  orderByStamp(truth, name, counters, warnings);
  return truth;
}

}  // namespace swiftlet
