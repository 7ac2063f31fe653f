#pragma once
// How well a tracked coordinate is known: the default of every setting that says so.

namespace swiftlet {

inline constexpr double kTrackPixelSigma = 0.45;  ///< px, 1 sigma

}  // namespace swiftlet
