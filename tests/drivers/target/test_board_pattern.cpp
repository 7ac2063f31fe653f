// The print of a board: its areas do not overlap, its corners are saddles, its codes are Kalibr's.
#include <catch2/catch.hpp>

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/target/board_pattern.hpp"

using namespace swiftlet;

namespace {

bool isBlack(const std::vector<BoardRectangle>& areas, double x, double y) {
  int hits = 0;
  for (const BoardRectangle& area : areas) {
    if (x > area.low.x() && x < area.high.x() && y > area.low.y() && y < area.high.y()) ++hits;
  }
  CHECK(hits <= 1);
  return hits == 1;
}

void checkSaddles(const CalibrationTarget& target) {
  const std::vector<BoardRectangle> areas = blackAreas(target);
  const BoardRectangle print = printedArea(target);
  const double step = 0.02 * target.size;
  for (int id = 0; id < target.cornerCount(); ++id) {
    const Eigen::Vector3d c = target.corner(id);
    CAPTURE(id);
    const bool first = isBlack(areas, c.x() - step, c.y() - step);
    CHECK(isBlack(areas, c.x() + step, c.y() + step) == first);
    CHECK(isBlack(areas, c.x() - step, c.y() + step) != first);
    CHECK(isBlack(areas, c.x() + step, c.y() - step) != first);
  }
  Eigen::Vector2d low = areas.front().low;
  Eigen::Vector2d high = areas.front().high;
  for (const BoardRectangle& area : areas) {
    low = low.cwiseMin(area.low);
    high = high.cwiseMax(area.high);
  }
  CHECK((low - print.low).norm() < 1e-12);
  CHECK((high - print.high).norm() < 1e-12);
}

}  // namespace

TEST_CASE("every corner of a board is a saddle") {
  checkSaddles({});
  checkSaddles({TargetKind::kAprilGrid, 3, 5, 0.04, 0.06, 0.25});
  checkSaddles({TargetKind::kCheckerboard, 9, 6, 0.025, 0.03, 0});
}

TEST_CASE("the square left of and below a checkerboard's first corner is black") {
  const CalibrationTarget target{TargetKind::kCheckerboard, 4, 3, 0.1, 0.1, 0};
  CHECK(isBlack(blackAreas(target), -0.05, -0.05));
}

TEST_CASE("an AprilGrid's tags carry the codes of Kalibr's boards") {
  // Codes of tag36h11 as the first AprilTag library lists them, row by row from the upper left cell, first
  // bit highest, 1 is white: tags 0, 1 and 35.
  const CalibrationTarget target;
  const std::vector<BoardRectangle> areas = blackAreas(target);
  const std::array<std::pair<int, std::uint64_t>, 3> codes{
      {{0, 0xd5d628584}, {1, 0xd97f18b49}, {35, 0x686d7002a}}};
  for (const auto& [tag, code] : codes) {
    const Eigen::Vector3d corner = target.corner(4 * tag);
    std::uint64_t read = 0;
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 6; ++column) {
        const double x = corner.x() + target.size * (2.5 + column) / 10;
        const double y = corner.y() + target.size * (7.5 - row) / 10;
        read = 2 * read + (isBlack(areas, x, y) ? 0 : 1);
      }
    }
    CAPTURE(tag);
    CHECK(read == code);
  }
}
