#pragma once
// Writes the messages of a log into a bag: topics /imu0, /cam0/image_raw, /cam0/camera_info, ...
// (docs/export.md).

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/bag/message_bag.hpp"
#include "drivers/bag/ros_messages.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

[[nodiscard]] rosmsg::Header bagHeader(Stamp stamp, const std::string& frame);
/// "cam0", "cam1", ...: the camera's frame and the first part of its topics.
[[nodiscard]] std::string cameraName(std::size_t camera);
/// `plumb_bob` or `equidistant`, unrectified.
[[nodiscard]] rosmsg::CameraInfo cameraInfoOf(const CameraModel& model);

/// In the sensor's own axes; rad/s, m/s^2.
void writeImu(MessageBag& bag, const ImuSample& sample);

/// 8-bit grey without row padding, with its CameraInfo.
void writePixels(MessageBag& bag, std::size_t camera, Stamp stamp, std::span<const std::uint8_t> pixels,
                 rosmsg::CameraInfo& info);
/// A PNG or JPEG file as compressed image, with its CameraInfo.
void writePicture(MessageBag& bag, std::size_t camera, Stamp stamp, std::span<const std::uint8_t> picture,
                  rosmsg::CameraInfo& info);

}  // namespace swiftlet
