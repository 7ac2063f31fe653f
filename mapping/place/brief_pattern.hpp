#pragma once
// The 256 comparisons of a descriptor: pairs of places in a patch, drawn from a normal distribution around
// its centre (Calonder, Lepetit, Strecha, Fua, "BRIEF: Binary Robust Independent Elementary Features", ECCV
// 2010).

#include <array>
#include <cstdint>

namespace swiftlet {

/// Places stay within this distance of the patch's centre, so that turning the pattern needs no larger patch.
inline constexpr int kPatchRadius = 15;  // px

struct BriefPair {
  std::int8_t x0 = 0, y0 = 0;  ///< px from the centre; the bit is set where this place is darker ...
  std::int8_t x1 = 0, y1 = 0;  ///< ... than this
};
using BriefPattern = std::array<BriefPair, 256>;

/// The pattern of every descriptor that swiftlet makes: a vocabulary is of use with its own pattern only.
const BriefPattern& briefPattern();

}  // namespace swiftlet
