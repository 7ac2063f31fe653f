#pragma once
// Output of the front-end for the smoother: the pixels of each landmark in this frame.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

using TrackId = std::uint64_t;

/// Observations of a landmark in one frame. Ids are not reused within an epoch.
struct TrackedFeature {
  TrackId id = 0;
  std::array<bool, kMaxCameras> seen{};
  std::array<Eigen::Vector2f, kMaxCameras> pixel{};  ///< distorted pixels, valid where seen
};

struct TrackedFrame {
  Stamp stamp;
  std::uint64_t index = 0;
  std::uint32_t timeline = 0;  ///< StereoFrame::timeline
  std::array<bool, kMaxCameras> camera_present{};
  bool keyframe = false;
  /// Number of frames refused since the last tracked one, and the stamp of the newest of them.
  int refused_before = 0;
  Stamp refused_stamp;
  FixedVector<TrackedFeature, kMaxFeatures> features;
};

}  // namespace swiftlet
