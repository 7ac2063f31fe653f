#pragma once
// Reads the messages of one ROS 2 topic: images, compressed images, inertial samples, camera calibrations.
//
// Quality of service: best effort and volatile, which matches every ROS 2 publisher. The newest kKeptImages
// images or kKeptSamples samples wait to be taken. Only the message's type is checked: sizes, encodings and
// numbers are as the publisher wrote them.
//
// Threads: one. It allocates and locks: not for a thread of the flight path. Memory: the waiting messages,
// and one of each largest size seen. Errors: open() returns the reason. Without DDS in the build it never
// opens.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/calibration/camera_info.hpp"
#include "drivers/dds/dds_domain.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// sensor_msgs/Image or CompressedImage. Its data stay in the reader's memory until the next take().
struct TopicImage {
  Stamp stamp;                ///< from the header, CLOCK_REALTIME
  bool compressed = false;    ///< compressed image: JPEG or PNG by its first bytes
  std::string_view encoding;  ///< "mono8"; for a compressed image its format, "jpeg"
  bool big_endian = false;
  std::uint32_t width = 0;   ///< px; 0 for a compressed image, as are height and step
  std::uint32_t height = 0;  ///< px
  std::uint32_t step = 0;    ///< bytes per row
  std::span<const std::uint8_t> data;
};

/// sensor_msgs/Imu.
struct TopicImu {
  Stamp stamp;            ///< from the header, CLOCK_REALTIME
  Eigen::Vector3d gyro;   ///< rad/s
  Eigen::Vector3d accel;  ///< m/s^2
};

enum class TopicType : std::uint8_t { kImage, kCompressedImage, kImu, kCameraInfo };

/// "sensor_msgs/msg/Image".
[[nodiscard]] const char* rosName(TopicType type);

/// Signals the arrival of messages; one bell for all readers of a thread.
class TopicBell {
 public:
  TopicBell();
  ~TopicBell();
  TopicBell(const TopicBell&) = delete;
  TopicBell& operator=(const TopicBell&) = delete;

  /// Readable from a ring until the next clear().
  [[nodiscard]] int fd() const { return fd_; }
  void ring() const;
  /// Call before taking the messages: later arrivals ring again.
  void clear() const;
  /// Waits until it rings, at most `longest`.
  void wait(Duration longest) const;

 private:
  int fd_ = -1;
};

struct TopicCounters {
  std::uint64_t taken = 0;
  std::uint64_t overrun = 0;  ///< overwritten by newer ones before they were taken
  std::uint64_t lost = 0;     ///< lost in transport, as far as DDS knows
};

class TopicReader {
 public:
  static constexpr int kKeptImages = 4;
  static constexpr int kKeptSamples = 400;

  TopicReader();
  ~TopicReader();
  TopicReader(const TopicReader&) = delete;
  TopicReader& operator=(const TopicReader&) = delete;

  /// Call once; `bell` must outlive this. False, with `error`: an invalid name, or the library's message.
  [[nodiscard]] bool open(std::shared_ptr<DdsDomain> domain, TopicType type, const std::string& name,
                          const TopicBell& bell, std::string& error);
  [[nodiscard]] bool isOpen() const { return entities_ != nullptr; }

  /// The oldest waiting message, if the topic has this type; false: none.
  bool take(TopicImage& image);
  bool take(TopicImu& sample);
  bool take(CameraInfo& info);

  /// Current number of publishers of this topic and type.
  [[nodiscard]] int publishers() const;
  [[nodiscard]] TopicCounters counters() const;

 private:
  struct Entities;
  /// Takes the next message with data into the reader's memory.
  bool takeNext();

  std::unique_ptr<Entities> entities_;
};

}  // namespace swiftlet
