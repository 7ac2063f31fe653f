#pragma once
// Paints a calibration board into the image of one camera of a rig, with exact edges.
//
// The corners of every pixel are traced to the board's plane, and the areas of white and black inside this
// quadrilateral are computed, not sampled: with a still camera an edge is within 2e-3 px of its projection.
// Motion during the exposure is a mean over instants at most kPixelsPerInstant apart; each row of a rolling
// shutter is seen at its own time. The board hides what is behind it; nothing hides the board. Frames and
// times as in camera_renderer.hpp. Cost: about 50 ns per pixel and instant. Memory: 12 bytes per pixel.

#include <array>
#include <vector>

#include "drivers/simulated/camera_renderer.hpp"
#include "drivers/simulated/ray_table.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/target/board_pattern.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// Radiance of printed paper: 1 is white in full light.
inline constexpr float kPaperWhite = 0.85F;
inline constexpr float kPaperBlack = 0.05F;

/// Black rectangles with fast queries of the black area inside a small quadrilateral.
class BoardRaster {
 public:
  explicit BoardRaster(const CalibrationTarget& target);

  struct Point {
    float x = 0;
    float y = 0;
  };
  using Quad = std::array<Point, 4>;  ///< corners in order around it
  struct Shares {
    float paper = 0;  ///< area of the quadrilateral that is on the sheet
    float black = 0;  ///< black area of the quadrilateral
  };
  [[nodiscard]] Shares shares(const Quad& quad) const;

 private:
  struct Box {
    Point low;
    Point high;
  };
  static float overlap(const Quad& quad, const Box& bounds, const Box& box);
  [[nodiscard]] const std::vector<Box>& near(float x, float y) const;

  Box sheet_;
  std::vector<Box> black_;
  float bin_ = 1;  ///< m, edge of a bin
  int columns_ = 1;
  int rows_ = 1;
  std::vector<std::vector<Box>> bins_;  ///< for each bin, the boxes within one bin's edge of it
};

class BoardRenderer {
 public:
  static constexpr double kPixelsPerInstant = 0.7;

  BoardRenderer(const CalibrationTarget& target, const SE3& T_world_board, const CameraModel& camera,
                const SE3& T_body_cam);

  /// Paints over `radiance`, an image of the same camera, at mid-exposure time `seconds` (of the middle row).
  void paint(const SplineTrajectory& trajectory, double seconds, const RenderSettings& settings,
             std::vector<float>& radiance) const;

 private:
  [[nodiscard]] int instantsFor(const SplineTrajectory& trajectory, double seconds, double exposure) const;
  void paintRow(const SplineTrajectory& trajectory, double seconds, double exposure, int instants, int row,
                float* radiance) const;

  BoardRaster raster_;
  SE3 T_board_world_;
  Eigen::Vector3d centre_;  ///< of the board, world axes
  CameraModel camera_;
  SE3 T_body_cam_;
  std::vector<Eigen::Vector3f> corner_;  ///< rays through the pixels' corners, (width + 1) (height + 1)
};

}  // namespace swiftlet
