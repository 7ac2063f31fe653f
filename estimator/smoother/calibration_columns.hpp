#pragma once
// Columns of the estimated calibration: image times (offset, then the readout of a rolling shutter), then
// phi, p of T_body_cam per camera.
//
// They come first in every system. A view has those of the times and of its own camera (kViewCalibrationDim).

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "estimator/core/limits.hpp"

namespace swiftlet {

inline constexpr int kExtrinsicDim = 6;
inline constexpr int kMostTimes = 2;
inline constexpr int kViewCalibrationDim = kMostTimes + kExtrinsicDim;
inline constexpr int kMaxCalibrationDim = kMostTimes + kExtrinsicDim * static_cast<int>(kMaxCameras);

struct CalibrationLayout {
  bool time_offset = false;
  bool extrinsics = false;
  std::size_t cameras = 0;
  bool readout = false;  ///< estimated together with the time offset

  [[nodiscard]] int times() const { return int{time_offset} + int{readout}; }
  [[nodiscard]] int dimension() const {
    return times() + (extrinsics ? kExtrinsicDim * static_cast<int>(cameras) : 0);
  }
  [[nodiscard]] int extrinsicOffset(std::size_t camera) const {
    return times() + kExtrinsicDim * static_cast<int>(camera);
  }
  /// For each column of a view its column in the system; -1 if not estimated.
  [[nodiscard]] std::array<int, kViewCalibrationDim> columnsOf(std::size_t camera) const {
    std::array<int, kViewCalibrationDim> columns{};
    columns[0] = time_offset ? 0 : -1;
    columns[1] = readout ? 1 : -1;
    for (std::size_t k = 0; k < kExtrinsicDim; ++k) {
      columns[kMostTimes + k] = extrinsics ? extrinsicOffset(camera) + static_cast<int>(k) : -1;
    }
    return columns;
  }
};

}  // namespace swiftlet
