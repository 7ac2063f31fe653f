#pragma once
// Finds the corners of a calibration board in a grey image.
//
// AprilGrid: libapriltag finds some tags in a copy of the image whose white areas are widened by a pixel (the
// squares at the tags' corners cut the white frame that it needs); if there is none, in the image enlarged
// twice. From these the board is followed tag by tag: the homography of the tags around predicts the next
// one, its four corners are refined (saddle.hpp), and it counts only if the grey values of its cells agree
// with the code that belongs there. So a tag is never taken for another one. The tags that remain form one
// connected part of the board.
//
// Checkerboard: OpenCV's search for all inner corners at once, each refined and its colours checked. A board
// whose squares, columns + rows + 2 of inner corners, are even in number looks the same when it is turned by
// 180 degrees (equal columns and rows: perhaps by 90): of the poses that the colours allow, the one is taken
// whose x axis points most to the right in the image. Such a board must be held so that both cameras and all
// images agree.
//
// Pixel (0,0) is the centre of the upper left pixel. Threads: one a detector; detectors share nothing. The
// same image gives the same corners. Memory: some 10 MB for the codes of the tags, and 10 bytes a pixel.
// Cost: some 30 ms for 752 x 480 with an AprilGrid, 100 ms where the image has none.

#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class BoardDetector {
 public:
  /// kQuick leaves out the enlarged image: for live use.
  enum class Effort : std::uint8_t { kQuick, kFull };

  explicit BoardDetector(const CalibrationTarget& target, Effort effort = Effort::kFull);
  BoardDetector(const BoardDetector&) = delete;
  BoardDetector& operator=(const BoardDetector&) = delete;
  ~BoardDetector();

  /// Corners by rising id; empty if the board is not seen.
  [[nodiscard]] std::vector<BoardCorner> detect(const ImageView& image);

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

}  // namespace swiftlet
