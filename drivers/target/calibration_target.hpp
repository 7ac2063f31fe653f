#pragma once
// A calibration board: the positions of its corners.
//
// Frames: board axes x right, y up, z = 0 on the print and out of it towards the viewer; metres. The origin
// is the lower left corner of the tag 0 (AprilGrid) or the lower left inner corner (checkerboard). AprilGrid
// (Kalibr's layout): tags of family tag36h11 with a black border of 2 bits; tag = columns row + column, row 0
// at the bottom; corner = 4 tag + (0 lower left, 1 lower right, 2 upper right, 3 upper left). Checkerboard:
// inner corners, corner = columns row + column, row 0 at the bottom.

#include <Eigen/Core>
#include <cstdint>

namespace swiftlet {

enum class TargetKind : std::uint8_t { kAprilGrid, kCheckerboard };

struct CalibrationTarget {
  TargetKind kind = TargetKind::kAprilGrid;
  int columns = 6;  ///< tags or inner corners per row
  int rows = 6;
  double size = 0.088;          ///< m: edge of a tag's black border, or width of a square
  double square_height = 0.06;  ///< m: checkerboard only
  double gap = 0.3;             ///< between tags, in tag edges: AprilGrid only

  [[nodiscard]] bool hasTags() const { return kind == TargetKind::kAprilGrid; }
  [[nodiscard]] int cornerCount() const { return columns * rows * (hasTags() ? 4 : 1); }
  [[nodiscard]] Eigen::Vector3d corner(int id) const;
};

}  // namespace swiftlet
