#pragma once
// The pixel window of an alignment and its weights.
//
// Weights are 1 if the pixel's distance from the centre, in a norm given by the caller, is at most the radius
// of the patch, and fall linearly to 0 over one more pixel. Stored in rows of kPatchLanes, a whole vector
// each; columns beyond the window have weight 0.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace swiftlet {

/// Window side in pixels, odd, at most 15, so that a row and one spare column fill a 16-lane vector.
inline constexpr int kPatchSize = 13;
inline constexpr int kPatchRadius = kPatchSize / 2;
inline constexpr int kPatchLanes = 16;
static_assert(kPatchSize % 2 == 1 && kPatchSize < kPatchLanes);

using PatchWindow = std::array<float, static_cast<std::size_t>(kPatchSize) * kPatchLanes>;

/// `norm`: maps (|x|, |y|) from the centre to a distance, all in pixels.
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
