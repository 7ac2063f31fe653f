#pragma once
// Converts a video and its IMU data to an EuRoC/ASL folder, which every command accepts as a log.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ImportRequest {
  std::string video;            ///< a video file, or the folder of a phone's log (data.jsonl, data.mp4)
  std::string imu;              ///< csv with EuRoC's columns; empty: the video's own data (GoPro)
  std::string calibration;      ///< written into the log; empty: none
  std::string imu_calibration;  ///< Kalibr's IMU file, if it is not beside the camchain
  std::optional<Stamp> first;   ///< time of the first image on the csv's clock; empty: 1 s
  std::string out;
};

struct ImportResult {
  std::size_t cameras = 0;
  std::size_t images = 0;  ///< of all cameras together
  std::uint64_t damaged = 0;
  std::size_t samples = 0;
  double imu_hz = 0;
  double seconds = 0;  ///< of images
  std::vector<std::string> warnings;
};

/// InputError: a file that cannot be read, a calibration for another image size, clocks that do not overlap,
/// or an existing log in `out`. Nothing is left in `out` then.
ImportResult importVideo(const ImportRequest& request);

}  // namespace swiftlet
