#pragma once
// Semi-global matching, one image row at a time: matching costs, costs aggregated along five paths, and the
// choice of disparities.
//
// The cost of disparity d at pixel p along a path that comes from its neighbour q is (Hirschmuller, PAMI
// 2008, eq. 12-13, written with costs whose least at every pixel has been taken off)
//   L(p,d) = C(p,d) + min(L(q,d), L(q,d-1) + P1, L(q,d+1) + P1, P2),
// with P2 smaller where the two pixels' grey differs. Four paths: along the row both ways, down and up the
// column. As many come from above as from below: paths from above alone drag what is seen there down slanted
// ground, which then comes out too far. All costs are bytes that stop at 255; sums of paths too, which only
// matters to disparities far from the best.
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
  const std::uint8_t* grey = nullptr;         ///< left image; one more pixel at both ends
  const std::uint8_t* grey_before = nullptr;  ///< the row that a path across rows comes from
  std::array<const std::uint8_t*, kCensusPlanes> left_signs{};
  std::array<const std::uint8_t*, kCensusPlanes> right_signs{};  ///< mirrored; 32 kVectors bytes behind
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

/// `costs` and `sums`: a row's, width x disparities. `neighbours`: costs along a path in the row that the
/// path comes from, less each pixel's least; afterwards this row's; zeros where a path begins. A byte before
/// and behind it is read.
///
/// Matching costs and the upward path (`grey_before`: the row below). Where `costs` and `sums` are not null:
/// the costs, and the sums of the upward and the leftward path.
template <typename Lanes, int kVectors>
void matchUpwards(const MatchingRow& row, const PathPenalties& penalties, std::uint8_t* neighbours,
                  std::uint8_t* costs, std::uint8_t* sums);

/// Adds the rightward and the downward path. `grey_before`: the row above.
template <typename Lanes, int kVectors>
void addDownwards(const MatchingRow& row, const PathPenalties& penalties, const std::uint8_t* costs,
                  std::uint8_t* neighbours, std::uint8_t* sums);

template <typename Lanes, int kVectors>
void chooseDisparities(const std::uint8_t* sums, int width, const DisparityChoice& choice);

}  // namespace swiftlet
