#pragma once
// Images on their way in: one camera's frame as a source gives it, and the pair after pairing.

#include <array>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class Clock : std::uint8_t { kMonotonic, kLog };

struct CameraFrame {
  Stamp stamp;    ///< mid-exposure
  Stamp arrival;  ///< when the last byte was there; equals `stamp` where a log does not say
  Clock clock = Clock::kLog;
  std::uint32_t camera = 0;    ///< 0 left, 1 right
  std::uint64_t sequence = 0;  ///< the device's own count
  std::uint64_t number = 0;    ///< of this camera's images that entered the estimator, from 1; 0: not counted
  std::uint32_t timeline =
      0;  ///< of the IMU's stamps (estimator/odometry/stamp_guard.hpp), with which it goes
  ImageView image;
};

/// One or two images of the same instant. The index counts pairs since the start.
struct StereoFrame {
  Stamp stamp;
  std::uint64_t index = 0;
  std::array<ImageView, kMaxCameras> image;         ///< empty() where that camera is missing
  std::array<std::uint64_t, kMaxCameras> number{};  ///< CameraFrame::number of each; 0 where missing
  std::uint32_t timeline = 0;                       ///< CameraFrame::timeline

  [[nodiscard]] bool has(std::size_t camera) const { return !image[camera].empty(); }
};

}  // namespace swiftlet
