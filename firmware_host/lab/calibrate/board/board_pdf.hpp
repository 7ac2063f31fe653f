#pragma once
// A calibration board as a PDF to print, to scale.
//
// One page of the paper's size: the board in its middle, a ruler of 100 mm along the lower edge and one along
// the left edge to check the print in both directions, and the board's sizes as text. Vector graphics.
// Lengths in metres, the page in points of 1/72 inch.

#include <Eigen/Core>
#include <string>

#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

/// Width and height [m] of "A4", "A3", "A2", "A1", "A0", "letter", "tabloid" or "WIDTHxHEIGHT" in mm, always
/// in landscape format. InputError naming `--paper`.
[[nodiscard]] Eigen::Vector2d paperSize(const std::string& name);

/// Columns and rows of a board on paper; 0: chosen automatically.
struct BoardLayout {
  TargetKind kind = TargetKind::kAprilGrid;
  int columns = 0;
  int rows = 0;
};

/// The largest board for the paper, with space for printer margins, the white frame and the rulers. Tags and
/// squares are multiples of 0.5 mm. InputError if they would be smaller than 5 mm.
[[nodiscard]] CalibrationTarget boardForPaper(const BoardLayout& layout, const Eigen::Vector2d& paper);

/// The content of the file; equal boards give equal bytes.
[[nodiscard]] std::string boardPdf(const CalibrationTarget& target, const Eigen::Vector2d& paper);

}  // namespace swiftlet
