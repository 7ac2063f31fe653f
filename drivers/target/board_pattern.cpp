#include "drivers/target/board_pattern.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>

namespace swiftlet {
namespace {

constexpr int kCells = 10;  ///< per side of a tag
constexpr int kBorder = 2;  ///< cells
constexpr int kPackagedBorder = 1;

using Cells = std::array<std::array<bool, kCells>, kCells>;  ///< [row from above][column]: black

Cells tagCells(const apriltag_family_t& family, int tag) {
  Cells black;
  for (auto& row : black) row.fill(true);
  for (std::size_t bit = 0; bit < family.nbits; ++bit) {
    const bool white = (family.codes[tag] >> (family.nbits - 1 - bit)) & 1U;
    const std::size_t shift = kBorder - kPackagedBorder;
    black[family.bit_y[bit] + shift][family.bit_x[bit] + shift] = !white;
  }
  return black;
}

/// Adds the runs of black cells of each row; equal runs of consecutive rows are joined.
void addTag(const Cells& black, const Eigen::Vector2d& lower_left, double size,
            std::vector<BoardRectangle>& areas) {
  const double cell = size / kCells;
  for (std::size_t row = 0; row < kCells;) {
    std::size_t end = row + 1;
    while (end < kCells && black[end] == black[row]) ++end;
    for (std::size_t column = 0; column < kCells;) {
      std::size_t stop = column + 1;
      if (black[row][column]) {
        while (stop < kCells && black[row][stop]) ++stop;
        const auto at = [&](std::size_t x, std::size_t y_from_above) -> Eigen::Vector2d {
          return lower_left +
                 cell * Eigen::Vector2d(static_cast<double>(x), static_cast<double>(kCells - y_from_above));
        };
        areas.push_back({at(column, end), at(stop, row)});
      }
      column = stop;
    }
    row = end;
  }
}

std::vector<BoardRectangle> aprilGrid(const CalibrationTarget& target) {
  const std::unique_ptr<apriltag_family_t, decltype(&tag36h11_destroy)> family(tag36h11_create(),
                                                                               &tag36h11_destroy);
  std::vector<BoardRectangle> areas;
  const double pitch = target.size * (1 + target.gap);
  const double square = target.size * target.gap;
  for (int tag = 0; tag < target.columns * target.rows; ++tag) {
    addTag(tagCells(*family, tag), target.corner(4 * tag).head<2>(), target.size, areas);
  }
  for (int row = 0; row <= target.rows; ++row) {
    for (int column = 0; column <= target.columns; ++column) {
      const Eigen::Vector2d low(pitch * column - square, pitch * row - square);
      areas.push_back({low, low + Eigen::Vector2d::Constant(square)});
    }
  }
  return areas;
}

std::vector<BoardRectangle> checkerboard(const CalibrationTarget& target) {
  std::vector<BoardRectangle> areas;
  const Eigen::Vector2d edge(target.size, target.square_height);
  for (int row = -1; row < target.rows; ++row) {
    for (int column = -1; column < target.columns; ++column) {
      if ((row + column) % 2 != 0) continue;
      const Eigen::Vector2d low = edge.cwiseProduct(Eigen::Vector2d(column, row));
      areas.push_back({low, low + edge});
    }
  }
  return areas;
}

}  // namespace

std::vector<BoardRectangle> blackAreas(const CalibrationTarget& target) {
  return target.hasTags() ? aprilGrid(target) : checkerboard(target);
}

BoardRectangle printedArea(const CalibrationTarget& target) {
  const Eigen::Vector2d last = target.corner(target.cornerCount() - (target.hasTags() ? 2 : 1)).head<2>();
  const Eigen::Vector2d beyond = target.hasTags() ? Eigen::Vector2d::Constant(target.size * target.gap)
                                                  : Eigen::Vector2d(target.size, target.square_height);
  return {-beyond, last + beyond};
}

double whiteMargin(const CalibrationTarget& target) {
  // A tag's white frame is as wide as the gap; detecting a chessboard needs about half a square.
  return target.hasTags() ? target.size * target.gap : 0.5 * std::min(target.size, target.square_height);
}

}  // namespace swiftlet
