#pragma once
// Whether images of two cameras show the board at the same moment.

namespace swiftlet {

/// s: largest difference between stamps of triggered cameras. At 1 m/s and 1 m it moves a corner by 0.5 px of
/// 500.
inline constexpr double kSameMoment = 1e-3;

}  // namespace swiftlet
