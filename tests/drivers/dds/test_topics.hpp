#pragma once
// What the driver of the tests publishes and who reads it expects: topics, and contents that show any tear.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace swiftlet::test {

inline constexpr std::array kTopicCameras = {"/camera/camera/infra1/image_rect_raw",
                                             "/camera/camera/infra2/image_rect_raw"};
inline constexpr std::array kTopicInfos = {"/camera/camera/infra1/camera_info",
                                           "/camera/camera/infra2/camera_info"};
inline constexpr const char* kTopicImu = "/camera/camera/imu";
inline constexpr const char* kTopicGyro = "/camera/camera/gyro/sample";
inline constexpr const char* kTopicAccel = "/camera/camera/accel/sample";

inline constexpr double kMadeUpImuRate = 400;  ///< Hz
inline constexpr double kMadeUpGravity = 9.81;

/// Of image `index` of a camera; it stands in the image's first bytes.
inline std::uint64_t patternOf(std::size_t camera, std::int64_t index) {
  return static_cast<std::uint64_t>(index + 1'000'000) * 2 + camera;
}

/// Every byte depends on `pattern`: a part of another image shows.
inline void fillPattern(std::span<std::uint8_t> out, std::uint64_t pattern) {
  std::uint64_t state = pattern;
  for (std::size_t at = 0; at < out.size(); at += sizeof(state)) {
    std::memcpy(out.data() + at, &state, std::min(sizeof(state), out.size() - at));
    state = state * 6364136223846793005U + 1442695040888963407U + pattern;
  }
}

/// Of sample `number`, whose acceleration is this with gravity along z.
inline Eigen::Vector3d madeUpGyro(std::uint64_t number) {
  const auto n = static_cast<double>(number);
  return {n * 1e-6, -n * 2e-6, n * 3e-6};
}

}  // namespace swiftlet::test
