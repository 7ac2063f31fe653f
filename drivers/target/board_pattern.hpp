#pragma once
// The print of a calibration board: its black areas as rectangles in board axes (calibration_target.hpp).
//
// AprilGrid, Kalibr's layout: a tag is 10 cells wide, with 2 cells of black border on each side; its code is
// upright for a viewer with y up. Black squares as wide as the gap touch the corners of every tag, also of
// the outermost ones, so that two black and two white areas meet at each corner. Checkerboard: the square
// left of and below corner 0 is black. The codes are libapriltag's tag36h11.
// Source: ethz-asl/kalibr, kalibr_create_target_pdf (layout only).

#include <Eigen/Core>
#include <vector>

#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

struct BoardRectangle {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();  ///< m
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
};

/// Largest number of tags on a board: the size of the family.
inline constexpr int kTagCount = 587;

/// Disjoint rectangles, which may touch; at most about 40 per tag.
[[nodiscard]] std::vector<BoardRectangle> blackAreas(const CalibrationTarget& target);

/// The rectangle around all black areas.
[[nodiscard]] BoardRectangle printedArea(const CalibrationTarget& target);

/// Width of the white margin that a board needs around printedArea() to be found [m].
[[nodiscard]] double whiteMargin(const CalibrationTarget& target);

}  // namespace swiftlet
