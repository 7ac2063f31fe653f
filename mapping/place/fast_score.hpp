#pragma once
// The corner score of FAST-9/16 for every pixel.
//
// The score is the largest t for which nine consecutive neighbours, on the circle of sixteen pixels with
// radius 3, are all brighter than the centre by at least t, or all darker (Rosten, Drummond, "Machine
// Learning for High-Speed Corner Detection", ECCV 2006). It is computed without branches for every pixel,
// because the best corners of each part of an image are needed whatever its contrast. Groups of pixels that
// cannot reach the least score of interest are set to 0 early.

#include <cstddef>
#include <cstdint>

#include "mapping/place/byte_lanes.hpp"

namespace swiftlet {

/// Bytes that fastScoreRow reads and writes beyond the last requested pixel.
inline constexpr int kFastScoreOverrun = 64;

/// Scores of the pixels [begin, end) of a row; writes whole vectors. Requires three rows above and below and
/// three pixels before `begin`. A score of at most `least` may be returned as 0. About 1 ns a pixel.
template <typename Lanes = byte_lanes::Native>
void fastScoreRow(const std::uint8_t* row, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                  std::uint8_t* score);

/// Sets `peaks` to nonzero for each pixel of [begin, end) whose score is at least `least` (> 0) and the
/// maximum of its 3 x 3 pixels (the first of equals in reading order); writes whole vectors. Requires rows
/// above and below and a pixel before `begin`.
template <typename Lanes = byte_lanes::Native>
void peaksOfRow(const std::uint8_t* scores, std::ptrdiff_t stride, int begin, int end, std::uint8_t least,
                std::uint8_t* peaks);

}  // namespace swiftlet
