#pragma once
// Binary descriptors of patches: 256 comparisons of two pixels each, rotated with the patch.
//
// The patch is smoothed (7 x 7 Gaussian, 2 px), its direction is that of its intensity centroid, and the
// pattern of comparisons is rotated by it (Rublee, Rabaud, Konolige, Bradski, "ORB: an efficient alternative
// to SIFT or SURF", ICCV 2011). The pattern is swiftlet's own (brief_pattern.hpp), so descriptors cannot be
// compared with those of other libraries.
//
// Memory: 64 KiB of rotated patterns, allocated by the constructor. About 0.7 us a descriptor.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mapping/place/brief_pattern.hpp"
#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

class SteeredBrief {
 public:
  SteeredBrief();

  /// Radius of the smoothing, and of all pixels read around a patch's centre.
  static constexpr int kSmoothRadius = 3;                       // px
  static constexpr int kBorder = kPatchRadius + kSmoothRadius;  // px
  static constexpr int kOverrun = 48;  ///< bytes read from the first of a row, some unused
  /// Number of directions.
  static constexpr int kDirections = 64;

  /// A smoothed patch: rows of 32 bytes, the first 31 used.
  static constexpr std::size_t kPatchSize = 2 * kPatchRadius + 1;
  static constexpr std::size_t kPatchStride = 32;
  using Patch = std::array<std::uint8_t, kPatchSize * kPatchStride>;

  /// `centre` points into an image with kBorder pixels on every side. In each row kOverrun bytes from the
  /// patch's first must be readable.
  static void smooth(const std::uint8_t* centre, std::ptrdiff_t stride, Patch& patch);
  /// Direction of the intensity centroid within kPatchRadius [rad], from +x towards +y.
  static float direction(const Patch& patch);
  [[nodiscard]] Descriptor describe(const Patch& patch, float direction) const;

 private:
  using Places = std::array<std::uint16_t, 512>;  ///< indices into a patch, two per comparison
  std::vector<Places> turned_;
};

}  // namespace swiftlet
