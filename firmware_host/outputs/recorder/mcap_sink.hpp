#pragma once
// A live recording as one MCAP file with ROS 2 messages: /imu0, /cam0/image_raw, /cam0/camera_info, ... as
// written by `swiftlet export` (docs/export.md), images uncompressed.
//
// One writer for all. The file has its final name from the beginning and is readable up to the last chunk of
// 1 MiB that was complete when the program was killed, or that was on the disk at a power cut.

#include <array>
#include <string>

#include "drivers/bag/message_bag.hpp"
#include "firmware_host/outputs/recorder/record_sink.hpp"

namespace swiftlet {

class McapSink final : public RecordSink {
 public:
  /// InputError if the file exists or cannot be written.
  McapSink(const std::string& file, const Calibration& calibration);
  ~McapSink() override { stopWriters(); }

 private:
  bool writeWaiting();
  void close() override { bag_.finish(); }

  MessageBag bag_;
  std::array<rosmsg::CameraInfo, kMaxCameras> info_;
};

}  // namespace swiftlet
