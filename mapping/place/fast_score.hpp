#pragma once
// How much of a corner each pixel is: the score of FAST-9/16.
//
// The score is the largest t for which nine neighbours in a row, on the circle of sixteen pixels with
// radius 3, are all brighter than the centre by at least t, or all darker (Rosten, Drummond, "Machine
// Learning for High-Speed Corner Detection", ECCV 2006). It is computed for every pixel without branches,
// since the best of each part of an image is wanted whatever its contrast; groups of pixels that cannot reach
// the least score of interest are left at 0 early.

#include <cstddef>
#include <cstdint>

#include "mapping/place/byte_lanes.hpp"

namespace swiftlet {

/// Bytes that fastScoreRow reads and writes beyond the last pixel asked for.
inline constexpr int kFastScoreOverrun = 64;

/// Scores of the pixels [begin, end) of a row; whole vectors are written. Rows three above and below exist,
/// and three pixels before `begin`. A score of at most `least` may come out as 0. About 1 ns a pixel.
template <typename Lanes = byte_lanes::Native>
void fastScoreRow(const std::uint8_t* row, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                  std::uint8_t* score);

/// Not 0 where a pixel of [begin, end) has a score of at least `least` (> 0) that is the maximum of its 3 x 3
/// pixels (of equals the first in reading order); whole vectors are written. Rows above and below exist, and
/// a pixel before `begin`.
template <typename Lanes = byte_lanes::Native>
void peaksOfRow(const std::uint8_t* scores, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                std::uint8_t* peaks);

}  // namespace swiftlet
