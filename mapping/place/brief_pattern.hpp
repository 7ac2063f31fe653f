#pragma once
// The 256 comparisons of a descriptor: pairs of pixels in a patch, chosen from pairs drawn from a normal
// distribution around its centre (Calonder, Lepetit, Strecha, Fua, "BRIEF: Binary Robust Independent
// Elementary Features", ECCV 2010).

#include <array>
#include <cstdint>

namespace swiftlet {

/// Pixels stay within this distance of the centre, so that rotating the pattern needs no larger patch.
inline constexpr int kPatchRadius = 15;  // px

struct BriefPair {
  std::int8_t x0 = 0, y0 = 0;  ///< px from the centre; the bit is set if this pixel is darker ...
  std::int8_t x1 = 0, y1 = 0;  ///< ... than this one
};
using BriefPattern = std::array<BriefPair, 256>;

/// The pattern of all descriptors. A vocabulary works only with the pattern that it was trained with.
const BriefPattern& briefPattern();

}  // namespace swiftlet
