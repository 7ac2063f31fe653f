#pragma once
// Semi-global matching, one image row at a time: matching costs, costs aggregated along five paths, and the
// choice of disparities.
//
// The cost of disparity d at pixel p along a path that comes from its neighbour q is (Hirschmuller, PAMI 2008,
// eq. 12-13, written with costs whose least at every pixel has been taken off)
//   L(p,d) = C(p,d) + min(L(q,d), L(q,d-1) + P1, L(q,d+1) + P1, P2),
// with P2 smaller where the two pixels' grey differs. Five paths: leftwards and rightwards along the row, and
// from the three neighbours in the row above. Their costs sum up in a row's buffer: no volume over the image
// is kept. All costs are bytes that stop at 255; sums too, which only matters to disparities far from best.
//
// Layout: byte buffers [pixel][disparity]; the right image's signs run from right to left, so that the
// candidates of a left pixel, x - d for rising d, are neighbours in memory. `Lanes` is an instruction set of
// disparity_lanes, kVectors times 32 the number of disparities. Bit for bit the same with all sets.

#include <array>
#include <cstdint>

#include "mapping/depth/census.hpp"

namespace swiftlet {

/// Disparities come in steps of 32, up to this many vectors of 32.
inline constexpr int kMaxDisparityVectors = 4;

struct PathPenalties {
  std::uint8_t small = 0;                 ///< P1: disparity changes by one
  std::array<std::uint8_t, 256> large{};  ///< P2: changes by more; by the difference in grey
  std::uint8_t outside = 0;               ///< matching cost where the other pixel is outside the right image
};

struct MatchingRow {
  int width = 0;
  const std::uint8_t* grey = nullptr;        ///< left image; one more pixel at both ends
  const std::uint8_t* grey_above = nullptr;  ///< the row above, likewise
  std::array<const std::uint8_t*, kCensusPlanes> left_signs{};
  std::array<const std::uint8_t*, kCensusPlanes> right_signs{};  ///< mirrored; 32 kVectors bytes behind
};

/// Buffers of (width + 1) x disparities, with a byte before and kDisparityLanes behind. Costs and sums hold
/// one row; the others the costs along a path of the row above, less each pixel's least. `from_above` and
/// `from_above_right` are afterwards those of this row. `from_above_left` holds pixel x's in slot x + 1, and
/// this row's go to `to_below_right`: the two change places from row to row. All zeros before the first row;
/// slot 0 of `from_above_left`, slot `width` of `from_above_right` always.
struct PathBuffers {
  std::uint8_t* costs = nullptr;
  std::uint8_t* sums = nullptr;
  std::uint8_t* from_above = nullptr;
  std::uint8_t* from_above_left = nullptr;
  std::uint8_t* to_below_right = nullptr;
  std::uint8_t* from_above_right = nullptr;
};

/// Per pixel of the row. Where sums are equal the least disparity wins.
struct DisparityChoice {
  std::uint8_t* disparity = nullptr;        ///< of the left image's pixels, whole pixels
  std::uint8_t* least = nullptr;            ///< its sum
  std::uint8_t* below = nullptr;            ///< sum of disparity - 1; 255 at the range's end
  std::uint8_t* above = nullptr;            ///< of disparity + 1
  std::uint8_t* second = nullptr;           ///< least sum of the disparities that are not neighbours
  std::uint8_t* right_disparity = nullptr;  ///< of the right image's pixels, from the same sums
};

/// Fills costs, and sums with the leftward path's.
template <typename Lanes, int kVectors>
void matchLeftwards(const MatchingRow& row, const PathPenalties& penalties, const PathBuffers& buffers);

/// Adds the four other paths.
template <typename Lanes, int kVectors>
void matchDownwards(const MatchingRow& row, const PathPenalties& penalties, const PathBuffers& buffers);

template <typename Lanes, int kVectors>
void chooseDisparities(const std::uint8_t* sums, int width, const DisparityChoice& choice);

}  // namespace swiftlet
