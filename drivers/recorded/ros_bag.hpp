#pragma once
// A ROS 1 bag (v2.0) through rosbag-storage; present only in builds that found it.
//
// Streams are found by type: sensor_msgs/Imu, sensor_msgs/Image, sensor_msgs/CompressedImage; where the
// Kalibr files name topics, those are taken, else the IMU topic with the most messages and the first
// two image topics by name. Stamps are the header's. A bag has no calibration: LogOptions::calibration
// must name one. Opening reads the bag once; memory 56 bytes a sample and about 150 an image.

#include <memory>
#include <string>

#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// True when the file begins like a bag. Known in every build, for the message.
bool isRosBag(const std::string& path);

/// InputError when the build cannot read bags, the bag is damaged, or a stream is missing.
std::unique_ptr<LogSource> openRosBag(const std::string& path, const LogOptions& options);

}  // namespace swiftlet
