#pragma once
// The window of pixels that an alignment looks at, and their weights.
//
// Weights: 1 where the pixel's distance from the centre, in a norm of the caller's, is at most the patch's
// radius, falling linearly to 0 over one more pixel. Stored in rows of kPatchLanes, a whole vector each;
// the columns beyond the window weigh nothing.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace swiftlet {

/// Window side in pixels, odd, at most 15: a row and one spare column fill a 16-lane vector.
inline constexpr int kPatchSize = 13;
inline constexpr int kPatchRadius = kPatchSize / 2;
inline constexpr int kPatchLanes = 16;
static_assert(kPatchSize % 2 == 1 && kPatchSize < kPatchLanes);

using PatchWindow = std::array<float, static_cast<std::size_t>(kPatchSize) * kPatchLanes>;

/// `norm`: (|x|, |y|) in pixels from the centre to a distance in pixels.
template <typename Norm>
PatchWindow makePatchWindow(const Norm& norm) {
  PatchWindow window{};
  for (int y = 0; y < kPatchSize; ++y) {
    for (int x = 0; x < kPatchSize; ++x) {
      const float distance = norm(std::abs(static_cast<float>(x - kPatchRadius)),
                                  std::abs(static_cast<float>(y - kPatchRadius)));
      const float edge = static_cast<float>(kPatchRadius) + 1.0F;
      window[static_cast<std::size_t>(y * kPatchLanes + x)] = std::clamp(edge - distance, 0.0F, 1.0F);
    }
  }
  return window;
}

}  // namespace swiftlet
