#pragma once
// Descriptors of patches: which of two places is brighter, 256 times, turned with the patch.
//
// The patch is smoothed (7 x 7 Gaussian, 2 px), its direction is that of its centroid of intensity, and the
// pattern of comparisons is turned by it (Rublee, Rabaud, Konolige, Bradski, "ORB: an efficient alternative
// to SIFT or SURF", ICCV 2011). The pattern is our own (brief_pattern.hpp): descriptors are compared with
// each other, not with another library's.
//
// Memory: 64 KiB of turned patterns, by the constructor. About 0.7 us a descriptor.

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

  /// Radius of the smoothing and of all that is read around a patch's centre.
  static constexpr int kSmoothRadius = 3;                       // px
  static constexpr int kBorder = kPatchRadius + kSmoothRadius;  // px
  static constexpr int kOverrun = 48;  ///< bytes read from a row's first, some without use
  /// Directions that are told apart.
  static constexpr int kDirections = 64;

  /// A smoothed patch, rows of 32 bytes of which the first 31 count.
  static constexpr std::size_t kPatchSize = 2 * kPatchRadius + 1;
  static constexpr std::size_t kPatchStride = 32;
  using Patch = std::array<std::uint8_t, kPatchSize * kPatchStride>;

  /// `centre` points into an image with kBorder pixels on every side, of whose rows kOverrun bytes from the
  /// patch's first may be read.
  static void smooth(const std::uint8_t* centre, std::ptrdiff_t stride, Patch& patch);
  /// Direction of the centroid of intensity within kPatchRadius [rad], from +x towards +y.
  static float direction(const Patch& patch);
  [[nodiscard]] Descriptor describe(const Patch& patch, float direction) const;

 private:
  using Places = std::array<std::uint16_t, 512>;  ///< into a patch, the two of a comparison after each other
  std::vector<Places> turned_;
};

}  // namespace swiftlet
