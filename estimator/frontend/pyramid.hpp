#pragma once
// An image pyramid: each level is the level below, smoothed by the 5-tap binomial filter (1 4 6 4 1)/16 in
// both directions and halved (Burt, Adelson, "The Laplacian Pyramid as a Compact Image Code", 1983). Pixel
// (x, y) of level k+1 is at (2x, 2y) of level k.
//
// Every level has a border of `kPyramidBorder` replicated pixels, so that kernels with their centre inside
// the image need no special case. Memory is reserved by the constructor (1.33 x pixels plus borders: 0.6 MiB
// for 752 x 480); `build` takes about 0.1 ms for that size.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

inline constexpr int kMaxPyramidLevels = 5;
/// Half a patch (8), one gradient pixel, a step beyond the edge and a 16-byte load after it.
inline constexpr int kPyramidBorder = 32;

class Pyramid {
 public:
  Pyramid() = default;
  /// Limits the levels to those whose shorter side is at least 16 pixels.
  Pyramid(int width, int height, int levels);
  Pyramid(Pyramid&&) = default;
  Pyramid& operator=(Pyramid&&) = default;

  /// Copies the image and builds all levels. The image must have the constructor's size.
  template <typename Isa = simd::Native>
  void build(const ImageView& image);

  [[nodiscard]] int levels() const { return levels_; }
  /// The view's data points to pixel (0, 0); rows and columns down to -kPyramidBorder may be read.
  [[nodiscard]] const ImageView& level(int index) const { return view_[static_cast<std::size_t>(index)]; }

 private:
  std::uint8_t* writableRow(int level, int y);
  void replicateBorder(int level);
  template <typename Isa>
  void halve(int from);

  int levels_ = 0;
  std::array<ImageView, kMaxPyramidLevels> view_{};
  std::array<std::size_t, kMaxPyramidLevels> origin_{};  ///< index of pixel (0, 0) in storage_
  std::vector<std::uint8_t> storage_;
  std::vector<std::int16_t> row_;  ///< one row filtered along y: even pixels, then odd pixels
};

}  // namespace swiftlet
