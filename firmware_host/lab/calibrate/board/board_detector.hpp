#pragma once
// Finds the corners of a calibration board in a grey image.
//
// AprilGrid: libapriltag finds some tags in a copy of the image whose white areas are widened by a pixel (the
// squares at the tags' corners cut the white frame that it needs). If there are none, it searches the image
// enlarged twice. From these the board is followed tag by tag: the homography of the neighbouring tags
// predicts the next one, its four corners are refined (saddle.hpp), and it is accepted only if the grey
// values of its cells agree with the expected code. So a tag is never mistaken for another. The accepted tags
// form one connected part of the board.
//
// Checkerboard: OpenCV searches for all inner corners at once; each is refined and its colours are checked.
// If columns + rows of inner corners is even, the board looks the same when turned by 180 degrees (with equal
// columns and rows perhaps by 90). Of the poses that the colours allow, the one is taken whose x axis points
// most to the right in the image. Such a board must be held so that both cameras and all images agree.
//
// Pixel (0,0) is the centre of the upper left pixel. Threads: one per detector; detectors share nothing. The
// same image gives the same corners. Memory: some 10 MB for the codes of the tags, and 10 bytes per pixel.
// Cost: some 30 ms for 752 x 480 with an AprilGrid, 100 ms if the image has none.

#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class BoardDetector {
 public:
  /// kQuick omits the enlarged image: for live use.
  enum class Effort : std::uint8_t { kQuick, kFull };

  explicit BoardDetector(const CalibrationTarget& target, Effort effort = Effort::kFull);
  BoardDetector(const BoardDetector&) = delete;
  BoardDetector& operator=(const BoardDetector&) = delete;
  ~BoardDetector();

  /// Corners ordered by id; empty if the board is not seen.
  [[nodiscard]] std::vector<BoardCorner> detect(const ImageView& image);

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

}  // namespace swiftlet
