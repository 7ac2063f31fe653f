#pragma once
// Centre-symmetric census: describes a pixel by the signs of the 31 differences between opposite pixels of
// its 9 x 7 window. The signs do not depend on the camera's gain and offset. None of them depends on the
// centre pixel, so noise flips fewer signs than in the plain census. The matching cost of two pixels is the
// number of signs that differ (0 .. 31). Sources: Zabih, Woodfill, ECCV 1994 (census); Spangenberg, Langner,
// Rojas, CAIP 2013 (centre-symmetric).
//
// Signs are kept in byte planes: plane p holds signs 8p .. 8p+7 of every pixel of a row.

#include <array>
#include <cstdint>

namespace swiftlet {

/// Rows and columns of the window on each side of its centre.
inline constexpr int kCensusRowReach = 3;
inline constexpr int kCensusColumnReach = 4;
inline constexpr int kCensusRows = 2 * kCensusRowReach + 1;
inline constexpr int kCensusSigns = (kCensusRows * (2 * kCensusColumnReach + 1) - 1) / 2;
inline constexpr int kCensusPlanes = (kCensusSigns + 7) / 8;

/// Pixel 0 of the window's rows, from the top, and of the planes.
using CensusRows = std::array<const std::uint8_t*, kCensusRows>;
using CensusPlanes = std::array<std::uint8_t*, kCensusPlanes>;

/// Signs of the pixels 0 .. width - 1 of a row. `mirrored`: the rows run from right to left; the signs are
/// those of the image that is not mirrored. Reads kCensusColumnReach columns before the rows and
/// kCensusColumnReach + disparity_lanes::kLanes after them; writes up to disparity_lanes::kLanes - 1 bytes
/// after the planes.
template <typename Lanes>
void censusRow(const CensusRows& rows, int width, bool mirrored, const CensusPlanes& planes);

}  // namespace swiftlet
