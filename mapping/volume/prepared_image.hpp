#pragma once
// A depth image prepared for the update: checked pixels, packed attributes, and a pyramid of free depth.
//
// A pixel is one number. Above 0: a measured depth. Below 0: free up to its absolute value, unknown beyond
// (masked labels, depths beyond the range). 0: unmeasured. One additional pixel, unmeasured, stands for
// everything outside the image. Buffers are reserved at construction.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/core/status.hpp"
#include "estimator/messages/depth_image.hpp"
#include "mapping/volume/volume_settings.hpp"

namespace swiftlet {

struct PixelCounters {
  std::uint64_t unmeasured = 0;  ///< zero, negative, NaN, infinite, or nearer than the range
  std::uint64_t beyond_range = 0;
  std::uint64_t uncertain = 0;  ///< sigma above most_sigma: free up to kSureSigmas in front of the depth
  std::uint64_t masked = 0;
  std::uint64_t bad_label = 0;  ///< out of range: treated as unknown
};

class PreparedImage {
 public:
  /// Edge of a tile at the finest level of the pyramid [px].
  static constexpr int kTile = 8;
  static constexpr int kMostLevels = 12;
  /// A measurement that is uncertain or beyond the range marks free space up to this many sigmas before it.
  static constexpr float kSureSigmas = 3;
  /// Limits the angle between ray and normal to 84 degrees.
  static constexpr float kLeastSlope = 0.1F;

  explicit PreparedImage(std::size_t most_pixels);

  /// kInvalidInput if the image is empty, has more than `most_pixels`, impossible intrinsics or no depth.
  [[nodiscard]] Status prepare(const DepthImageView& image, const VolumeSettings& settings,
                               PixelCounters& counters);

  [[nodiscard]] const PinholeIntrinsics& camera() const { return camera_; }
  /// width * height + 1 values.
  [[nodiscard]] const float* depth() const { return depth_.data(); }
  /// Converts depth in front of a pixel's surface to distance from that surface [m/m]: the cosine between ray
  /// and normal times the length of the ray per metre of depth. From differences of inverse depth, which is
  /// linear in the pixel on a plane. Of the two neighbours along an axis the one nearer in depth is used, so
  /// that the edge of an object does not tilt its normal. 1 where nothing was measured.
  [[nodiscard]] const float* slope() const { return slope_.data(); }
  /// Weight of each pixel, in kWeightSteps; null if all have evenWeight().
  [[nodiscard]] const float* weight() const { return is_even_ ? nullptr : weight_.data(); }
  [[nodiscard]] float evenWeight() const { return even_weight_; }
  /// Null if the image has none.
  [[nodiscard]] const std::uint8_t* grey() const { return grey_; }
  [[nodiscard]] const std::uint8_t* labels() const { return has_labels_ ? label_.data() : nullptr; }

  /// A depth [m] up to which all of the rectangle (inclusive, within the image) is free; 0 if one of its
  /// tiles has a hole, two unmeasured pixels that touch: an object without measured depth may stand there.
  /// A lower bound: coarse levels of the pyramid make it smaller, never larger.
  [[nodiscard]] float freeDepth(int left, int top, int right, int bottom) const;
  /// The deepest measured pixel of the tile (column, row at level 0), or 0.
  [[nodiscard]] float deepest(int column, int row) const {
    return deepest_[static_cast<std::size_t>(row) * static_cast<std::size_t>(level_[0].width) +
                    static_cast<std::size_t>(column)];
  }
  /// The least measured depth of each tile, rows of tileColumns().
  [[nodiscard]] const float* nearest() const { return nearest_.data(); }
  [[nodiscard]] int tileColumns() const { return level_[0].width; }
  [[nodiscard]] int tileRows() const { return level_[0].height; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Level {
    int width = 0;
    int height = 0;
    std::size_t first = 0;  ///< in free_
  };

  void checkPixels(const DepthImageView& image, const VolumeSettings& settings, PixelCounters& counters);
  void checkLabels(const DepthImageView& image, const VolumeSettings& settings, PixelCounters& counters);
  void findSlopes();
  [[nodiscard]] bool isHole(int u, int v) const;
  void buildPyramid();

  std::size_t most_pixels_;
  PinholeIntrinsics camera_;
  std::vector<float> depth_;
  std::vector<float> weight_;
  std::vector<float> slope_;
  std::vector<float> inverse_;  ///< inverse depth; 0 where nothing was measured
  std::vector<std::uint8_t> label_;
  const std::uint8_t* grey_ = nullptr;
  bool has_labels_ = false;
  bool is_even_ = true;
  float even_weight_ = 0;
  std::vector<float> free_;
  std::vector<float> deepest_;
  std::vector<float> nearest_;
  Level level_[kMostLevels];
  int levels_ = 0;
};

}  // namespace swiftlet
