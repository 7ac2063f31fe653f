#pragma once
// The data of a keyframe for place recognition: descriptors, pixels, bearings and depths of its features.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// A binary descriptor of 256 bits; bit i is bit i % 64 of word i / 64.
struct Descriptor {
  std::array<std::uint64_t, 4> words{};
  bool operator==(const Descriptor&) const = default;
};

inline constexpr std::size_t kMaxPlaceFeatures = 512;

struct PlaceFeature {
  Descriptor descriptor;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();     ///< camera 0, distorted
  Eigen::Vector3f bearing = Eigen::Vector3f::UnitZ();  ///< camera 0, unit
  float inverse_depth = 0;                             ///< 1/m along the bearing (1 / distance); 0: unknown
  float inverse_depth_sigma = 0;                       ///< 1/m
  std::int8_t octave = 0;                              ///< of the image pyramid
  bool has_landmark = false;
  TrackId landmark = 0;  ///< the odometry's, if has_landmark
};

struct PlaceKeyframe {
  std::uint64_t index = 0;  ///< of the frame
  Stamp stamp;
  std::uint32_t epoch = 0;
  FixedVector<PlaceFeature, kMaxPlaceFeatures> features;
};

}  // namespace swiftlet
