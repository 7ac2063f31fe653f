#pragma once
// Searches all images of a log for a board.
//
// The log needs no calibration: none is read (LogOptions::uncalibrated). Images are decoded one by one and
// searched in batches by as many threads as the machine has, each with its own detector; the result does not
// depend on their number. Memory: 16 images and a detector per thread, plus the views. Cost: 20 to 50 ms per
// image of 752 x 480 on one thread.

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <string>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

struct LogViewsRequest {
  std::string log;
  CalibrationTarget target;
  bool mono = false;                        ///< camera 0 alone
  bool show_progress = false;               ///< on stderr
  const std::atomic<bool>* stop = nullptr;  ///< set: stop reading here
};

struct LogViews {
  std::vector<BoardView> views;    ///< of every image, including those without the board, in the log's order
  std::vector<ImuSample> samples;  ///< the IMU's own axes; empty: the log has none
  std::size_t camera_count = 0;
  std::array<Eigen::Vector2i, kMaxCameras> image_size{Eigen::Vector2i::Zero(), Eigen::Vector2i::Zero()};
  std::array<std::size_t, kMaxCameras> images{};      ///< searched
  std::array<std::size_t, kMaxCameras> with_board{};  ///< images with the board
  std::vector<std::string> warnings;                  ///< about the log, for the user
};

/// Hz, from the median interval of the camera's images; 0: fewer than two.
[[nodiscard]] double imageRate(const std::vector<BoardView>& views, std::size_t camera);

/// InputError if the log cannot be read.
[[nodiscard]] LogViews readLogViews(const LogViewsRequest& request);

}  // namespace swiftlet
