#pragma once
// Input images: the frame of one camera as a source delivers it, and the pair after pairing.

#include <array>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class Clock : std::uint8_t { kMonotonic, kLog };

struct CameraFrame {
  Stamp stamp;    ///< mid-exposure
  Stamp arrival;  ///< when the last byte was received; equals `stamp` if a log does not have it
  Clock clock = Clock::kLog;
  std::uint32_t camera = 0;    ///< 0 left, 1 right
  std::uint64_t sequence = 0;  ///< sequence number of the device
  std::uint64_t number = 0;    ///< count of this camera's images in the estimator, from 1; 0: unknown
  std::uint32_t timeline = 0;  ///< time line of the IMU's stamps (odometry/stamp_guard.hpp)
  ImageView image;
};

/// One or two images of the same instant. The index counts pairs since the start.
struct StereoFrame {
  Stamp stamp;
  std::uint64_t index = 0;
  std::array<ImageView, kMaxCameras> image;         ///< empty() if that camera is missing
  std::array<std::uint64_t, kMaxCameras> number{};  ///< CameraFrame::number of each; 0 if missing
  std::uint32_t timeline = 0;                       ///< CameraFrame::timeline

  [[nodiscard]] bool has(std::size_t camera) const { return !image[camera].empty(); }
};

}  // namespace swiftlet
