// The printed board: rasterized by another program and found where it should be, to scale.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/target/target_file.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/calibrate/board/board_detector.hpp"
#include "firmware_host/lab/calibrate/board/board_pdf.hpp"
#include "tests/firmware_host/calibrate/board_image.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;

namespace {

/// A binary PGM, 8 bits.
test::GreyImage readPgm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  test::GreyImage image;
  int largest = 0;
  file >> magic >> image.width >> image.height >> largest;
  file.get();
  REQUIRE(magic == "P5");
  image.pixels.resize(static_cast<std::size_t>(image.width * image.height));
  file.read(reinterpret_cast<char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
  REQUIRE(file);
  return image;
}

void checkPrint(const BoardLayout& layout, const std::string& paper) {
  constexpr double kDotsPerInch = 150;
  constexpr double kSnapped = 0.7;  // px: the rasterizer moves straight edges to whole pixels
  ScratchFolder folder("board_pdf");
  const CalibrationTarget target = boardForPaper(layout, paperSize(paper));
  const std::string pdf = boardPdf(target, paperSize(paper));
  CHECK(pdf == boardPdf(target, paperSize(paper)));
  writeWholeFile(folder.file("board.pdf"), pdf);
  const std::string draw =
      "pdftoppm -gray -singlefile -r 150 " + folder.file("board.pdf") + " " + folder.file("board");
  REQUIRE(std::system(draw.c_str()) == 0);
  const test::GreyImage image = readPgm(folder.file("board.pgm"));
  CAPTURE(paper, describe(target));
  const double metre = kDotsPerInch / 0.0254;
  CHECK(std::abs(image.width - paperSize(paper).x() * metre) < 2);
  const std::vector<BoardCorner> corners = BoardDetector(target).detect(image.view());
  REQUIRE(corners.size() == static_cast<std::size_t>(target.cornerCount()));
  // Straight on: a pixel is the same length everywhere, and y is up.
  const Eigen::Vector2d first = corners.front().pixel;
  for (const BoardCorner& corner : corners) {
    const Eigen::Vector2d along = target.corner(corner.id).head<2>() * metre;
    CHECK((corner.pixel - first - Eigen::Vector2d(along.x(), -along.y())).norm() < kSnapped);
  }
}

}  // namespace

TEST_CASE("a printed board is found complete and to scale") {
  if (std::system("command -v pdftoppm > /dev/null") != 0) {
    skipCase("pdftoppm (package poppler-utils) is not installed", "apt-get install poppler-utils");
    return;
  }
  checkPrint({TargetKind::kAprilGrid, 0, 0}, "A4");
  checkPrint({TargetKind::kAprilGrid, 4, 3}, "letter");
  checkPrint({TargetKind::kCheckerboard, 0, 0}, "A3");
}

TEST_CASE("a paper that is none, and a board too fine, are refused") {
  CHECK_THROWS_AS(paperSize("B7"), InputError);
  CHECK_THROWS_AS(paperSize("20x10"), InputError);
  CHECK(paperSize("300x500").isApprox(Eigen::Vector2d(0.5, 0.3)));
  CHECK_THROWS_AS(boardForPaper({TargetKind::kAprilGrid, 100, 60}, paperSize("A4")), InputError);
  CHECK_THROWS_WITH(boardForPaper({TargetKind::kAprilGrid, 30, 30}, paperSize("A0")), Catch::Contains("587"));
  CHECK(boardForPaper({TargetKind::kAprilGrid, 29, 20}, paperSize("A0")).cornerCount() == 4 * 580);
}

TEST_CASE("a sheet names the rulers that it has") {
  if (std::system("command -v pdftotext > /dev/null") != 0) {
    skipCase("pdftotext (package poppler-utils) is not installed", "apt-get install poppler-utils");
    return;
  }
  const auto wordsOf = [](const std::string& paper) {
    const ScratchFolder folder("board_words");
    const CalibrationTarget target = boardForPaper({TargetKind::kAprilGrid, 3, 3}, paperSize(paper));
    writeWholeFile(folder.file("board.pdf"), boardPdf(target, paperSize(paper)));
    const std::string read = "pdftotext " + folder.file("board.pdf") + " " + folder.file("board.txt");
    REQUIRE(std::system(read.c_str()) == 0);
    return test::textOf(folder.file("board.txt"));
  };
  CHECK(wordsOf("A4").find("Both rulers are") != std::string::npos);
  CHECK(wordsOf("200x100").find("The ruler is") != std::string::npos);
  const std::string small = wordsOf("80x80");
  CHECK(small.find("ruler") == std::string::npos);
  CHECK(small.find("AprilGrid of 3 x 3 tags") != std::string::npos);
}
