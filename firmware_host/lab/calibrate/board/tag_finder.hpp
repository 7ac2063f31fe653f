#pragma once
// Finds tags of Kalibr's boards with libapriltag: tag36h11 with a black border of two cells. Corners are
// accurate to a pixel or two. Threads: one. Private to this folder.

#include <apriltag/apriltag.h>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"

namespace swiftlet {

struct FoundTag {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners;  ///< lower left, lower right, upper right, upper left
};

class TagFinder {
 public:
  TagFinder();
  TagFinder(const TagFinder&) = delete;
  TagFinder& operator=(const TagFinder&) = delete;
  ~TagFinder();

  /// Ordered by id; ids seen twice are omitted. `twice`: searches the image enlarged by two.
  [[nodiscard]] std::vector<FoundTag> find(const ImageView& image, bool twice);

  /// The 36 cells of a tag's code, rows from the top: 1 white, -1 black.
  using Code = Eigen::Matrix<double, 36, 1>;
  [[nodiscard]] Code code(int id) const;

 private:
  apriltag_family_t* family_ = nullptr;
  apriltag_detector_t* detector_ = nullptr;
  std::vector<std::uint8_t> enlarged_, widened_;
};

}  // namespace swiftlet
