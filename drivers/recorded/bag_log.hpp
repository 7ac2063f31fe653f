#pragma once
// A log in a bag of any kind (drivers/bag): rosbag2, MCAP, ROS 1.
//
// Streams are found by type: sensor_msgs/Imu, Image, CompressedImage. If the calibration names topics, those
// are used; otherwise the IMU topic with the most messages, and the first image topics by name whose images
// have the calibration's size. A gyroscope and an accelerometer on two topics are joined (join_imu.hpp).
// Stamps are the header's. A bag holds no calibration: LogOptions::calibration must name one. Truth: a topic
// of poses whose name indicates it; its body frame is assumed to be the IMU. Opening reads the bag once;
// memory 56 bytes per sample and about 100 per message.

#include <memory>
#include <string>

#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// InputError when the bag is damaged, the build cannot read its kind, or a stream is missing.
[[nodiscard]] std::unique_ptr<LogSource> openBagLog(const std::string& path, const LogOptions& options);

}  // namespace swiftlet
