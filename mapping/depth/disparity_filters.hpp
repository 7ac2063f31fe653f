#pragma once
// Filters of a disparity image: remove speckles, smooth outliers, fill small holes.
// Fixed memory, allocated by the constructor; deterministic.

#include <cstdint>
#include <vector>

#include "mapping/depth/disparity_image.hpp"

namespace swiftlet {

/// Removes patches of fewer than `least_pixels` connected pixels. 4-neighbours that differ by at most `step`
/// are connected. Union-find over runs of pixels within rows (He, Chao, Suzuki, IEEE TIP 2008, without their
/// second scan of pixels). Memory: 16 bytes a pixel, for the worst case of one run per pixel.
class SpeckleFilter {
 public:
  SpeckleFilter(int width, int height);

  /// `image` has the constructor's size. `step`: 1/kDisparitySteps px. Returns the number of removed pixels.
  std::size_t remove(DisparityImage& image, int least_pixels, int step);

 private:
  struct Run {
    std::uint32_t begin;   ///< index of the first pixel, over all rows
    std::uint32_t parent;  ///< an earlier run, or itself
    std::uint32_t pixels;  ///< at a root: size of the patch
  };

  [[nodiscard]] std::uint32_t root(std::uint32_t run);
  void join(std::uint32_t a, std::uint32_t b);
  void findRuns(const std::uint16_t* row, std::uint32_t begin, int width, int step);
  void joinRows(const std::uint16_t* image, std::uint32_t above, std::uint32_t above_end, std::uint32_t below,
                int width, int step);

  std::vector<Run> runs_;
  std::vector<std::uint32_t> ends_;  ///< of the runs of two rows
  std::size_t used_ = 0;
};

/// Median of 3 x 3 that also fills holes. A pixel without a disparity takes the median of its neighbours if
/// at least kHoleNeighbours of the eight have one and these are within a pixel of each other; its sigma is
/// then kDisparitySteps (1 px). In the median of a pixel with a disparity, its own value replaces those of
/// neighbours without one. The border of the image keeps its values.
class MedianFilter {
 public:
  static constexpr int kHoleNeighbours = 5;

  MedianFilter(int width, int height);
  void filter(DisparityImage& image);

 private:
  void filterRow(const std::uint16_t* above, const std::uint16_t* here, const std::uint16_t* below,
                 std::uint16_t* out, std::uint8_t* sigma, int width);

  std::vector<std::uint16_t> rows_;   ///< two unfiltered rows
  std::vector<std::uint16_t> known_;  ///< neighbours that have a disparity
};

}  // namespace swiftlet
