#pragma once
// Determines during a recording for calibration what it still lacks.
//
// From the corners in some images per second, and from all IMU samples:
//  - coverage: the image in 6 x 4 cells; a cell counts with kCellCorners corners in sharp images. Four cells
//    may stay empty: the corners of a fisheye's image are dark.
//  - distance: the board's scale must change by kScaleRange.
//  - tilt: kTiltedViews images each with the board's left, right, upper and lower side nearer by kTilt or
//    more. This uses the local linear map of the board without any calibration, so it only counts boards in
//    the middle of the image and is accurate to some degrees.
//  - both cameras at once: kSharedViews pairs.
//  - motion: kTurnedSeconds above kTurnRate about each IMU axis, kPushedSeconds above kPush along each.
//  - blur: images whose edges are wider than kWidestEdge do not count.
// The recording is sufficient once nothing is missing, but not before 25 s. The amounts follow the
// recommendations of calibration tools (30 to 60 s, all rotations and translations). How accurate the
// parameters are is then shown by the calibration's own covariance.
// One thread. Memory: bounded. Cost: some 50 us per image in addition to corner detection.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class CalibrationGuide {
 public:
  static constexpr int kColumns = 6;
  static constexpr int kRows = 4;
  static constexpr int kCellCorners = 8;
  static constexpr int kMostEmpty = 4;
  static constexpr double kScaleRange = 1.5;
  static constexpr double kTilt = 0.35;  ///< rad
  static constexpr int kTiltedViews = 3;
  static constexpr int kSharedViews = 40;
  static constexpr int kBoardViews = 100;       ///< per camera
  static constexpr double kTurnRate = 0.2;      ///< rad/s
  static constexpr double kTurnedSeconds = 10;  ///< s
  static constexpr double kPush = 0.5;          ///< m/s^2 from the mean of the last second
  static constexpr double kPushedSeconds = 10;  ///< s
  static constexpr double kWidestEdge = 3.5;    ///< px, from dark to bright

  struct Camera {
    int width = 0;
    int height = 0;
    int images = 0;
    int with_board = 0;
    int blurred = 0;                               ///< images with the board that are blurred
    std::array<int, kColumns * kRows> cells{};     ///< corners in each cell
    std::array<int, 4> tilted{};                   ///< images with left, right, upper, lower side nearer
    double smallest_scale = 0, largest_scale = 0;  ///< px/m
    double edge_width = 0;                         ///< px, of the newest image with the board
    std::vector<BoardCorner> corners;              ///< of the newest image

    [[nodiscard]] int covered() const;
  };

  CalibrationGuide(const CalibrationTarget& target, std::size_t cameras);

  /// Takes the corners of an image, in the order of the stamps. `edge_width`: edgeWidth() of this image.
  void addView(const BoardView& view, int width, int height, double edge_width);
  void addImu(const ImuSample& sample);

  [[nodiscard]] const Camera& camera(std::size_t index) const { return camera_[index]; }
  [[nodiscard]] std::size_t cameras() const { return cameras_; }
  [[nodiscard]] const Eigen::Vector3d& turnedSeconds() const { return turned_; }
  [[nodiscard]] const Eigen::Vector3d& pushedSeconds() const { return pushed_; }

  /// What to do next, most urgent first, one sentence each; empty: the recording is sufficient.
  [[nodiscard]] std::vector<std::string> missing() const;
  /// Share of the required data that has been recorded, 0 to 1.
  [[nodiscard]] double progress() const;

 private:
  void measureTilt(const BoardView& view, Camera& camera) const;
  void missingOf(std::size_t index, std::vector<std::string>& missing) const;

  CalibrationTarget target_;
  std::size_t cameras_;
  std::array<Camera, kMaxCameras> camera_;
  std::array<Stamp, kMaxCameras> board_seen_{};
  int shared_ = 0;
  Eigen::Vector3d turned_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d pushed_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_force_ = Eigen::Vector3d::Zero();
  bool has_sample_ = false;
  Stamp last_sample_;
};

/// px from dark to bright across the board's edges near these corners: grey range over steepest slope, median
/// over the corners; 0 without corners. A sharp image has 1.5 to 2.
[[nodiscard]] double edgeWidth(const ImageView& image, const std::vector<BoardCorner>& corners);

}  // namespace swiftlet
