#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>

#include "drivers/dds/topic_reader.hpp"

namespace swiftlet {

const char* rosName(TopicType type) {
  switch (type) {
    case TopicType::kImage:
      return "sensor_msgs/msg/Image";
    case TopicType::kCompressedImage:
      return "sensor_msgs/msg/CompressedImage";
    case TopicType::kImu:
      return "sensor_msgs/msg/Imu";
    case TopicType::kCameraInfo:
      return "sensor_msgs/msg/CameraInfo";
  }
  return "";
}

TopicBell::TopicBell() : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

TopicBell::~TopicBell() {
  if (fd_ >= 0) close(fd_);
}

void TopicBell::ring() const {
  const std::uint64_t one = 1;
  static_cast<void>(!write(fd_, &one, sizeof(one)));
}

void TopicBell::clear() const {
  std::uint64_t rings = 0;
  static_cast<void>(!read(fd_, &rings, sizeof(rings)));
}

void TopicBell::wait(Duration longest) const {
  constexpr std::int64_t kNsPerMs = 1'000'000;
  pollfd waiting{fd_, POLLIN, 0};
  poll(&waiting, 1, static_cast<int>(longest.ns / kNsPerMs));
}

}  // namespace swiftlet
