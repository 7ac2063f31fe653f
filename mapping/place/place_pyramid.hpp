#pragma once
// Image pyramid for features that are recognized from nearer or farther away.
//
// Level l is the image scaled by kOctaveRatio^-l, made from the level before by bilinear interpolation in
// fixed point. Rows are padded so that kernels may read whole vectors. Memory: some 3.3 bytes a pixel of the
// image, reserved by the constructor. About 1 ms for 752 x 480.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

/// Scale from one octave to the next (ORB's).
inline constexpr double kOctaveRatio = 1.2;
inline constexpr int kMaxOctaves = 8;

class PlacePyramid {
 public:
  PlacePyramid(int width, int height, int octaves);

  [[nodiscard]] int octaves() const { return octaves_; }
  /// False, without effect, for an image of another size.
  template <typename Isa = simd::Native>
  [[nodiscard]] bool build(const ImageView& image);
  [[nodiscard]] ImageView level(int octave) const;
  /// Converts between pixels of a level and of the image; (0,0) is the centre of a pixel in both.
  [[nodiscard]] Eigen::Vector2f toImage(int octave, const Eigen::Vector2f& pixel) const;
  [[nodiscard]] Eigen::Vector2f toLevel(int octave, const Eigen::Vector2f& pixel) const;

 private:
  struct Level {
    int width = 0;
    int height = 0;
    int stride = 0;
    Eigen::Array2f ratio = Eigen::Array2f::Ones();  ///< pixels of the image per pixel, along x and y
    std::vector<std::uint8_t> pixels;
    /// Source of eight consecutive columns in the level before: the first column, and from there the left
    /// neighbours and the weights of the right ones.
    std::vector<std::int32_t> first;
    std::vector<std::int16_t> left, weight;
  };

  template <typename Isa>
  void shrink(const Level& from, Level& to);

  int octaves_;
  std::array<Level, kMaxOctaves> levels_;
  std::vector<std::uint8_t> row_;  ///< a row blended from two rows of a level
};

}  // namespace swiftlet
