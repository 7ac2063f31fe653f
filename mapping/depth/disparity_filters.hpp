#pragma once
// What follows the choice of disparities: speckles away, outliers smoothed, small holes closed.
// Fixed memory, taken by the constructor; deterministic.

#include <cstdint>
#include <vector>

#include "mapping/depth/disparity_image.hpp"

namespace swiftlet {

/// Removes patches of fewer than `least_pixels` connected pixels: 4-neighbours that differ by at most `step`
/// belong together. Union-find over runs of pixels within rows (He, Chao, Suzuki, IEEE TIP 2008, without
/// their second scan of pixels). Memory: 16 bytes a pixel (every pixel a run of its own).
class SpeckleFilter {
 public:
  SpeckleFilter(int width, int height);

  /// `image` of the constructor's size. `step`: 1/kDisparitySteps px. Returns the pixels removed.
  std::size_t remove(DisparityImage& image, int least_pixels, int step);

 private:
  struct Run {
    std::uint32_t begin;   ///< pixel, over all rows
    std::uint32_t parent;  ///< a run before, or itself
    std::uint32_t pixels;  ///< at a root: of the patch
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

/// Median of 3 x 3, and holes closed: a pixel without a disparity takes the median of its neighbours where at
/// least kHoleNeighbours of the eight have one and these lie within a pixel of each other; its sigma is then
/// kDisparitySteps (1 px). In the median of a pixel that has a disparity, it stands for neighbours without
/// one. The image's border keeps its values.
class MedianFilter {
 public:
  static constexpr int kHoleNeighbours = 5;

  MedianFilter(int width, int height);
  void filter(DisparityImage& image);

 private:
  void filterRow(const std::uint16_t* above, const std::uint16_t* here, const std::uint16_t* below,
                 std::uint16_t* out, std::uint8_t* sigma, int width);

  std::vector<std::uint16_t> rows_;   ///< two rows as they were
  std::vector<std::uint16_t> known_;  ///< neighbours that have a disparity
};

}  // namespace swiftlet
