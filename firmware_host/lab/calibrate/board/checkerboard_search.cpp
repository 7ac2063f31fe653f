#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/calib3d.hpp>

#include "firmware_host/lab/calibrate/board/grid_search.hpp"
#include "firmware_host/lab/calibrate/board/saddle.hpp"

namespace swiftlet {
namespace {

constexpr double kSquareWindow = 0.4;  ///< of a square's width, so that only one crossing is inside
constexpr double kSmallestWindow = 2;  ///< px
constexpr double kLargestWindow = 6;   ///< px
constexpr double kMostMoved = 0.25;    ///< of a square's width, from OpenCV's corner
constexpr double kLeastRefined = 0.9;  ///< share of corners; with fewer the board is hidden or not a board

/// Inner corners in the image; row 0 is at the bottom of the board.
struct CornerGrid {
  int columns = 0;
  int rows = 0;
  std::vector<Eigen::Vector2d> pixels;

  [[nodiscard]] const Eigen::Vector2d& at(int column, int row) const {
    return pixels[static_cast<std::size_t>(columns * row + column)];
  }
  /// Vector to the next corner in the row or column.
  [[nodiscard]] Eigen::Vector2d alongRow(int column, int row) const {
    return column + 1 < columns ? at(column + 1, row) - at(column, row)
                                : at(column, row) - at(column - 1, row);
  }
  [[nodiscard]] Eigen::Vector2d alongColumn(int column, int row) const {
    return row + 1 < rows ? at(column, row + 1) - at(column, row) : at(column, row) - at(column, row - 1);
  }
};

CornerGrid mirrored(const CornerGrid& grid) {
  CornerGrid out = grid;
  for (int row = 0; row < grid.rows; ++row) {
    std::copy_n(grid.pixels.begin() + grid.columns * (grid.rows - 1 - row), grid.columns,
                out.pixels.begin() + grid.columns * row);
  }
  return out;
}

/// Turns by 90 degrees if columns and rows are equal, otherwise by 180.
CornerGrid turned(const CornerGrid& grid) {
  CornerGrid out = grid;
  if (grid.columns != grid.rows) {
    std::reverse(out.pixels.begin(), out.pixels.end());
    return out;
  }
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      out.pixels[static_cast<std::size_t>(grid.columns * row + column)] =
          grid.at(row, grid.rows - 1 - column);
    }
  }
  return out;
}

std::vector<BoardCorner> refine(const ImageView& image, const CornerGrid& grid) {
  std::vector<BoardCorner> corners;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      SaddleGuess guess;
      guess.pixel = grid.at(column, row);
      guess.edge1 = grid.alongRow(column, row);
      guess.edge2 = grid.alongColumn(column, row);
      guess.dark_between = (column + row) % 2 == 0;
      const double area = std::abs(guess.edge1.x() * guess.edge2.y() - guess.edge1.y() * guess.edge2.x());
      const double height = area / std::max(guess.edge1.norm(), guess.edge2.norm());
      guess.radius = std::clamp(kSquareWindow * height, kSmallestWindow, kLargestWindow);
      Saddle saddle;
      if (!refineSaddle(image, guess, saddle)) continue;
      if ((saddle.pixel - guess.pixel).norm() > std::max(1.5, kMostMoved * height)) continue;
      corners.push_back({grid.columns * row + column, saddle.pixel});
    }
  }
  const double needed = kLeastRefined * grid.columns * grid.rows;
  if (static_cast<double>(corners.size()) < needed) corners.clear();
  return corners;
}

}  // namespace

std::vector<BoardCorner> findCheckerboard(const ImageView& image, const CalibrationTarget& target) {
  // OpenCV does not write into the image.
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                     static_cast<std::size_t>(image.stride));
  std::vector<cv::Point2f> found;
  const int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
  if (!cv::findChessboardCorners(grey, cv::Size(target.columns, target.rows), found, flags)) return {};
  CornerGrid grid{target.columns, target.rows, {}};
  for (const cv::Point2f& point : found) grid.pixels.emplace_back(point.x, point.y);
  // Seen from its front, the board's y axis is to the left of its x axis, in an image with y pointing down.
  const Eigen::Vector2d x = grid.alongRow(0, 0);
  const Eigen::Vector2d y = grid.alongColumn(0, 0);
  if (x.x() * y.y() - x.y() * y.x() > 0) grid = mirrored(grid);

  // Orientations in order of how far the x axis points to the right; the first with the right colours is
  // taken.
  std::vector<CornerGrid> orientations = {grid};
  for (int turn = 1; turn < (grid.columns == grid.rows ? 4 : 2); ++turn) {
    orientations.push_back(turned(orientations.back()));
  }
  const auto rightward = [](const CornerGrid& g) {
    return (g.at(g.columns - 1, 0) - g.at(0, 0) + g.at(g.columns - 1, g.rows - 1) - g.at(0, g.rows - 1))
        .normalized()
        .x();
  };
  std::stable_sort(orientations.begin(), orientations.end(),
                   [&](const CornerGrid& a, const CornerGrid& b) { return rightward(a) > rightward(b); });
  for (const CornerGrid& orientation : orientations) {
    std::vector<BoardCorner> corners = refine(image, orientation);
    if (!corners.empty()) return corners;
  }
  return {};
}

}  // namespace swiftlet
