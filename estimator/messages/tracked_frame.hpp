#pragma once
// What the front-end hands to the smoother: where each landmark was seen in this frame.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

using TrackId = std::uint64_t;

/// A landmark's sightings in one frame. An id is never reused within an epoch.
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
  /// Frames refused since the last tracked one, and the newest refused one's stamp.
  int refused_before = 0;
  Stamp refused_stamp;
  FixedVector<TrackedFeature, kMaxFeatures> features;
};

}  // namespace swiftlet
