#pragma once
// What is printed on a calibration board: its black areas as rectangles in board axes
// (calibration_target.hpp).
//
// AprilGrid, Kalibr's layout: a tag is 10 cells wide, 2 of them black border on each side, its code upright
// for a viewer whose y is up; black squares as wide as the gap touch the corners of every tag, the outermost
// too, so that each corner is where two black and two white areas meet. Checkerboard: the square left of and
// below corner 0 is black. The codes are libapriltag's tag36h11.
// Source: ethz-asl/kalibr, kalibr_create_target_pdf (layout alone).

#include <Eigen/Core>
#include <vector>

#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

struct BoardRectangle {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();  ///< m
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
};

/// Largest number of tags on a board: the family's.
inline constexpr int kTagCount = 587;

/// Disjoint; they may touch. At most some 40 a tag.
[[nodiscard]] std::vector<BoardRectangle> blackAreas(const CalibrationTarget& target);

/// The rectangle around all black areas.
[[nodiscard]] BoardRectangle printedArea(const CalibrationTarget& target);

/// White that a board needs around `printedArea` to be found [m].
[[nodiscard]] double whiteMargin(const CalibrationTarget& target);

}  // namespace swiftlet
