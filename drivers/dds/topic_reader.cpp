#include "drivers/dds/topic_reader.hpp"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

#include "drivers/dds/ros_messages.h"  // made by idlc from ros_messages.idl

namespace swiftlet {
namespace {

const dds_topic_descriptor_t& descriptorOf(TopicType type) {
  switch (type) {
    case TopicType::kImage:
      return sensor_msgs_msg_dds__Image__desc;
    case TopicType::kCompressedImage:
      return sensor_msgs_msg_dds__CompressedImage__desc;
    case TopicType::kImu:
      return sensor_msgs_msg_dds__Imu__desc;
    case TopicType::kCameraInfo:
      break;
  }
  return sensor_msgs_msg_dds__CameraInfo__desc;
}

Stamp stampOf(const std_msgs_msg_dds__Header_& header) {
  constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
  return {header.stamp.sec * kNanosecondsPerSecond + header.stamp.nanosec};
}

Eigen::Vector3d vectorOf(const geometry_msgs_msg_dds__Vector3_& v) { return {v.x, v.y, v.z}; }

std::string_view textOf(const char* text) { return text != nullptr ? text : ""; }

}  // namespace

struct TopicReader::Entities {
  std::shared_ptr<DdsDomain> domain;
  TopicType type = TopicType::kImage;
  const TopicBell* bell = nullptr;
  dds_entity_t topic = 0;
  dds_entity_t reader = 0;
  // Written by the library's threads.
  std::atomic<std::uint64_t> came{0};
  std::atomic<std::uint64_t> lost{0};
  std::uint64_t kept = 0;   ///< capacity for waiting messages
  std::uint64_t taken = 0;  ///< messages with data
  std::uint64_t overrun = 0;
  std::uint64_t came_before = 0, taken_before = 0;  ///< at the last time none was waiting

  /// The message taken last; the memory of its sequences is reused.
  union Message {
    sensor_msgs_msg_dds__Image_ image;
    sensor_msgs_msg_dds__CompressedImage_ picture;
    sensor_msgs_msg_dds__Imu_ imu;
    sensor_msgs_msg_dds__CameraInfo_ info;
  } message{};

  /// Call when none is waiting. If at least `kept` messages were taken since the last call, those that
  /// arrived beyond them were overrun.
  void noteEmpty(std::uint64_t came_by_now) {
    const std::uint64_t came_since = came_by_now - came_before;
    const std::uint64_t taken_since = taken - taken_before;
    if (taken_since >= kept && came_since > taken_since) overrun += came_since - taken_since;
    came_before = came_by_now;
    taken_before = taken;
  }

  Entities() = default;
  Entities(const Entities&) = delete;
  Entities& operator=(const Entities&) = delete;
  ~Entities() {
    // Delete the reader first: this waits for its listener.
    if (reader > 0) dds_delete(reader);
    if (topic > 0) dds_delete(topic);
    dds_sample_free(&message, &descriptorOf(type), DDS_FREE_CONTENTS);
  }
};

TopicReader::TopicReader() = default;
TopicReader::~TopicReader() = default;

bool TopicReader::open(std::shared_ptr<DdsDomain> domain, TopicType type, const std::string& name,
                       const TopicBell& bell, std::string& error) {
  if (name.empty() || name.front() != '/') {
    error = "a ROS topic name starts with /, unlike '" + name + "'";
    return false;
  }
  auto made = std::make_unique<Entities>();
  Entities& e = *made;
  e.domain = std::move(domain);
  e.type = type;
  e.bell = &bell;
  e.topic =
      dds_create_topic(e.domain->participant(), &descriptorOf(type), ("rt" + name).c_str(), nullptr, nullptr);
  const bool images = type == TopicType::kImage || type == TopicType::kCompressedImage;
  const int kept = images ? kKeptImages : kKeptSamples;
  e.kept = static_cast<std::uint64_t>(kept);
  dds_qos_t* qos = topicQuality(false, kept);
  dds_listener_t* listener = dds_create_listener(&e);
  dds_lset_data_available(listener, [](dds_entity_t, void* to) {
    auto& entities = *static_cast<Entities*>(to);
    entities.came.fetch_add(1, std::memory_order_relaxed);
    entities.bell->ring();
  });
  dds_lset_sample_lost(listener, [](dds_entity_t, const dds_sample_lost_status_t status, void* to) {
    static_cast<Entities*>(to)->lost.store(status.total_count, std::memory_order_relaxed);
  });
  if (e.topic > 0) e.reader = dds_create_reader(e.domain->participant(), e.topic, qos, listener);
  dds_delete_listener(listener);
  dds_delete_qos(qos);
  if (e.topic < 0 || e.reader < 0) {
    error = "topic " + name + " cannot be read (" + dds_strretcode(std::min(e.topic, e.reader)) + ")";
    return false;
  }
  entities_ = std::move(made);
  return true;
}

bool TopicReader::takeNext() {
  if (!entities_) return false;
  Entities& e = *entities_;
  constexpr int kMost = kKeptSamples;  // messages without data only say that a publisher has left
  for (int looked = 0; looked < kMost; ++looked) {
    const std::uint64_t came = e.came.load(std::memory_order_relaxed);
    void* sample = &e.message;
    dds_sample_info_t info;
    if (dds_take(e.reader, &sample, &info, 1, 1) <= 0) {
      e.noteEmpty(came);
      return false;
    }
    if (!info.valid_data) continue;
    ++e.taken;
    return true;
  }
  return false;
}

bool TopicReader::take(TopicImage& image) {
  if (!entities_ || entities_->type > TopicType::kCompressedImage || !takeNext()) return false;
  const Entities::Message& m = entities_->message;
  image = {};
  if (entities_->type == TopicType::kImage) {
    image.stamp = stampOf(m.image.header);
    image.encoding = textOf(m.image.encoding);
    image.big_endian = m.image.is_bigendian != 0;
    image.width = m.image.width;
    image.height = m.image.height;
    image.step = m.image.step;
    image.data = {m.image.data._buffer, m.image.data._length};
  } else {
    image.stamp = stampOf(m.picture.header);
    image.compressed = true;
    image.encoding = textOf(m.picture.format);
    image.data = {m.picture.data._buffer, m.picture.data._length};
  }
  return true;
}

bool TopicReader::take(TopicImu& sample) {
  if (!entities_ || entities_->type != TopicType::kImu || !takeNext()) return false;
  const sensor_msgs_msg_dds__Imu_& m = entities_->message.imu;
  sample = {stampOf(m.header), vectorOf(m.angular_velocity), vectorOf(m.linear_acceleration)};
  return true;
}

bool TopicReader::take(CameraInfo& info) {
  if (!entities_ || entities_->type != TopicType::kCameraInfo || !takeNext()) return false;
  const sensor_msgs_msg_dds__CameraInfo_& m = entities_->message.info;
  info.width = static_cast<int>(m.width);
  info.height = static_cast<int>(m.height);
  info.distortion_model = textOf(m.distortion_model);
  info.D.assign(m.d._buffer, m.d._buffer + m.d._length);
  std::ranges::copy(m.k, info.K.begin());
  std::ranges::copy(m.r, info.R.begin());
  std::ranges::copy(m.p, info.P.begin());
  return true;
}

int TopicReader::publishers() const {
  dds_subscription_matched_status_t status{};
  if (!entities_ || dds_get_subscription_matched_status(entities_->reader, &status) < 0) return 0;
  return static_cast<int>(status.current_count);
}

TopicCounters TopicReader::counters() const {
  if (!entities_) return {};
  return {entities_->taken, entities_->overrun, entities_->lost.load(std::memory_order_relaxed)};
}

}  // namespace swiftlet
