#pragma once
// Semi-global matching, one image row at a time: matching costs, their aggregation along four paths, and the
// choice of disparities.
//
// The cost of disparity d at pixel p along a path that comes from its neighbour q is (Hirschmuller, PAMI
// 2008, eq. 12-13, with the least cost subtracted at every pixel)
//   L(p,d) = C(p,d) + min(L(q,d), L(q,d-1) + P1, L(q,d+1) + P1, P2),
// with P2 smaller if the grey values of the two pixels differ. Four paths: along the row in both directions,
// down and up the column. As many come from above as from below, because paths from above alone bias slanted
// ground towards larger distances. Costs are bytes that saturate at 255, and so are sums of paths, which only
// affects disparities far from the best.
//
// Layout: byte buffers [pixel][disparity]. The right image's signs run from right to left, so that the
// candidates of a left pixel, x - d for ascending d, are neighbours in memory. `Lanes` is an instruction set
// of disparity_lanes; 32 kVectors is the number of disparities. All instruction sets give the same bits.

#include <array>
#include <cstdint>

#include "mapping/depth/census.hpp"

namespace swiftlet {

/// The number of disparities is a multiple of 32, up to this many vectors of 32.
inline constexpr int kMaxDisparityVectors = 4;

struct PathPenalties {
  std::uint8_t small = 0;                 ///< P1: disparity changes by one
  std::array<std::uint8_t, 256> large{};  ///< P2: disparity changes by more; by the difference in grey value
  std::uint8_t outside = 0;               ///< matching cost if the other pixel is outside the right image
};

struct MatchingRow {
  int width = 0;
  const std::uint8_t* grey = nullptr;         ///< left image; one more pixel at both ends
  const std::uint8_t* grey_before = nullptr;  ///< row of q, for a path across rows
  std::array<const std::uint8_t*, kCensusPlanes> left_signs{};
  std::array<const std::uint8_t*, kCensusPlanes> right_signs{};  ///< mirrored; 32 kVectors bytes longer
};

/// Results per pixel of the row. The smallest of equal disparities wins.
struct DisparityChoice {
  std::uint8_t* disparity = nullptr;        ///< of the left image's pixels, whole pixels
  std::uint8_t* least = nullptr;            ///< sum of the chosen disparity
  std::uint8_t* below = nullptr;            ///< sum of disparity - 1; 255 at the end of the range
  std::uint8_t* above = nullptr;            ///< sum of disparity + 1; 255 at the end of the range
  std::uint8_t* second = nullptr;           ///< least sum among disparities that are not neighbours of it
  std::uint8_t* right_disparity = nullptr;  ///< of the right image's pixels, from the same sums
};

/// `costs` and `sums`: of a row, width x disparities. `neighbours`: costs along the path in the row of q,
/// less the least of each pixel; zeros where a path begins. They are replaced by those of this row. One byte
/// before and one after `neighbours` are read.
///
/// Computes matching costs and the upward path (`grey_before`: the row below). If `costs` and `sums` are not
/// null, they receive the costs, and the sums of the upward and the leftward path.
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
