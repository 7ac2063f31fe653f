#pragma once
// Centre-symmetric census: a pixel's window of 9 x 7 as the signs of the 31 differences between places that
// face each other across it. Neither gain nor offset of a camera changes them, and no sign hangs on the one
// pixel in the centre, so noise flips fewer of them than those of the plain census. Two pixels' matching cost
// is the number of signs that differ (0 .. 31).
// Sources: Zabih, Woodfill, ECCV 1994 (census); Spangenberg, Langner, Rojas, CAIP 2013 (centre-symmetric).
//
// Signs are kept in byte planes: plane p holds signs 8p .. 8p+7 of every pixel of a row.

#include <array>
#include <cstdint>

namespace swiftlet {

/// Rows and columns that the window reaches to each side of its centre.
inline constexpr int kCensusRowReach = 3;
inline constexpr int kCensusColumnReach = 4;
inline constexpr int kCensusRows = 2 * kCensusRowReach + 1;
inline constexpr int kCensusSigns = (kCensusRows * (2 * kCensusColumnReach + 1) - 1) / 2;
inline constexpr int kCensusPlanes = (kCensusSigns + 7) / 8;

/// Pixel 0 of the window's rows, from the top; and of the planes.
using CensusRows = std::array<const std::uint8_t*, kCensusRows>;
using CensusPlanes = std::array<std::uint8_t*, kCensusPlanes>;

/// Signs of a row's pixels 0 .. width - 1. `mirrored`: the rows run from right to left, and the signs are to
/// be those of the image as it is. Reads kCensusColumnReach columns before the rows and kCensusColumnReach +
/// disparity_lanes::kLanes behind them; writes up to disparity_lanes::kLanes - 1 bytes behind the planes.
template <typename Lanes>
void censusRow(const CensusRows& rows, int width, bool mirrored, const CensusPlanes& planes);

}  // namespace swiftlet
