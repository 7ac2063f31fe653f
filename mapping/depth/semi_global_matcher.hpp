#pragma once
// Dense disparities of a rectified pair by semi-global matching (Hirschmuller, PAMI 2008): centre-symmetric
// census, four paths, equiangular sub-pixel, left-right check from the same sums, speckle filter, median.
// Works in strips of rows: the upward path begins kRowsAhead rows below a strip, so no cost volume of the
// whole image is kept. Equations: docs/depth.md.
//
// Input: rectified images of the constructor's size; x_right = x_left - disparity on the same row. Output:
// DisparityImage for the pixels of the left image. Errors: kInvalidInput (an image missing or of another
// size); the output is then unchanged. Memory: fixed by the constructor, 16 bytes a pixel and 98 rows of
// width x disparities bytes (10.5 MB at 752 x 480 and 64 disparities). Time is proportional to pixels x
// disparities. One thread, no clock, no randomness; native and scalar instruction sets give the same bytes.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "mapping/depth/disparity_filters.hpp"
#include "mapping/depth/disparity_image.hpp"
#include "mapping/depth/disparity_lanes.hpp"
#include "mapping/depth/path_aggregation.hpp"

namespace swiftlet {

/// Costs are numbers of census signs that differ, 0 .. 31. The defaults were chosen jointly on pairs with
/// true disparity and on rendered flights.
struct MatcherSettings {
  int disparities = 64;            ///< 0 .. disparities - 1 px: 32, 64, 96 or 128
  int small_penalty = 12;          ///< P1: disparity changes by one pixel between neighbours
  int large_penalty = 100;         ///< P2: disparity changes by more, at equal grey values
  int large_penalty_falloff = 15;  ///< difference in grey levels that halves the large penalty
  int least_large_penalty = 12;
  int outside_cost = 10;         ///< matching cost if the other pixel is outside the right image
  int left_right_tolerance = 1;  ///< px, between disparities of both images; negative: no check
  int least_lead = 0;            ///< least lead of the best sum over the next best that is not its neighbour
  int speckle_pixels = 60;       ///< patches smaller than this are removed; 0: none
  double speckle_step = 1;       ///< px, largest difference between neighbours of a patch
  bool median = true;            ///< median of 3 x 3, which also fills small holes
};

class SemiGlobalMatcher {
 public:
  /// Settings outside their ranges are clamped.
  SemiGlobalMatcher(int width, int height, const MatcherSettings& settings = {});

  /// `disparities`: number searched in this call, at most the settings' (0: the settings'); fewer take less
  /// time and lose near objects. `disparity` has the constructor's size.
  template <typename Lanes = disparity_lanes::Native>
  Status match(const ImageView& left, const ImageView& right, int disparities, DisparityImage& disparity);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const MatcherSettings& settings() const { return settings_; }

 private:
  /// Rows of a strip, and rows below it where the upward path begins. Between kRowsAhead rows and the sum of
  /// both influence a pixel from below.
  static constexpr int kStripRows = 48;
  static constexpr int kRowsAhead = 16;
  /// Kept rows of one image, with margins: the strip, the rows ahead and the census window around them.
  static constexpr int kKeptRows = 72;
  static_assert(kStripRows + kRowsAhead + 2 * kCensusRowReach <= kKeptRows);

  struct Block {
    alignas(64) std::uint8_t bytes[64];
  };

  template <typename Lanes, int kVectors>
  void matchRows(const ImageView& left, const ImageView& right, DisparityImage& disparity);
  template <typename Lanes, int kVectors>
  void matchStrip(int begin, int end, int ahead, DisparityImage& disparity);
  void keepRow(const ImageView& left, const ImageView& right, int y);
  [[nodiscard]] std::uint8_t* leftRow(int y);
  [[nodiscard]] std::uint8_t* rightRow(int y);
  template <typename Lanes>
  void census(int y);
  [[nodiscard]] MatchingRow matchingRow(int y, int y_before);
  [[nodiscard]] std::uint8_t* costs(int y) {
    return costs_[static_cast<std::size_t>(y % kStripRows) * row_blocks_].bytes;
  }
  [[nodiscard]] std::uint8_t* sums(int y) {
    return sums_[static_cast<std::size_t>(y % kStripRows) * row_blocks_].bytes;
  }
  [[nodiscard]] static std::array<std::uint8_t, 64 * 64> makeSigmas();
  void refineRow(int disparities, std::uint16_t* disparity) const;
  void checkRow(std::uint16_t* disparity, std::uint8_t* sigma) const;

  int width_;
  int height_;
  MatcherSettings settings_;
  PathPenalties penalties_;
  std::array<std::uint8_t, 64 * 64> sigmas_;  ///< 1/kDisparitySteps px, by lead / 4 and rise / 4 of sums
  int row_bytes_;                             ///< of a kept row with its margins
  std::vector<std::uint8_t> left_rows_;
  std::vector<std::uint8_t> right_rows_;  ///< mirrored
  std::vector<std::uint8_t> left_signs_;
  std::vector<std::uint8_t> right_signs_;
  std::size_t row_blocks_;    ///< of a row of costs
  std::vector<Block> costs_;  ///< kStripRows rows
  std::vector<Block> sums_;
  std::vector<Block> from_above_;  ///< a row with a block at both ends
  std::vector<Block> from_below_;
  std::vector<std::uint8_t> choice_rows_;
  DisparityChoice choice_;
  SpeckleFilter speckles_;
  MedianFilter median_;
};

}  // namespace swiftlet
