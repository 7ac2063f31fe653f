#pragma once
// A live recording as one MCAP file of ROS 2's messages: /imu0, /cam0/image_raw, /cam0/camera_info, ... as
// `swiftlet export` gives them of a log (docs/export.md), images as pixels.
//
// One writer for all. The file has its name from the beginning: what a power cut leaves is whole up to the
// last chunk of 1 MiB, and is read so.

#include <array>
#include <string>

#include "drivers/bag/message_bag.hpp"
#include "firmware_host/outputs/recorder/record_sink.hpp"

namespace swiftlet {

class McapSink final : public RecordSink {
 public:
  /// InputError if the file is there already or cannot be written.
  McapSink(const std::string& file, const Calibration& calibration);
  ~McapSink() override { stopWriters(); }

 private:
  bool writeWaiting();
  void close() override { bag_.finish(); }

  MessageBag bag_;
  std::array<rosmsg::CameraInfo, kMaxCameras> info_;
};

}  // namespace swiftlet
