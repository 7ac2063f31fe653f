#pragma once
// Default standard deviation of a tracked coordinate, shared by all settings for it.

namespace swiftlet {

inline constexpr double kTrackPixelSigma = 0.45;  ///< px, 1 sigma

}  // namespace swiftlet
