#pragma once
// Planes found by the mesher with the landmarks on them, for the smoother, which ties the landmarks to them.
//
// A report holds the complete state, not changes, so a reader may skip reports.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

enum class PlaneDirection : std::uint8_t {
  kHorizontal,  ///< floor, ceiling, table: the normal is along z
  kVertical,    ///< wall: the normal is orthogonal to z
};

/// n . p = distance, world.
struct ReportedPlane {
  std::uint64_t id = 0;  ///< from 1; never reused within an epoch
  PlaneDirection direction = PlaneDirection::kHorizontal;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, towards the observed side
  double distance = 0;                                ///< m
};

struct ReportedPoint {
  TrackId id = 0;
  std::uint64_t plane = 0;  ///< id of the plane that it lies on
  /// False: one of the plane's points, but too uncertain to be distinguished from an object in front of it.
  /// Such points are drawn on the plane but not tied to it.
  bool firm = true;
};

struct PlaneReport {
  std::uint32_t epoch = 0;
  Stamp stamp;                    ///< of the keyframe at which it was made
  std::uint64_t frame_index = 0;  ///< of that keyframe
  FixedVector<ReportedPlane, kMaxPlanes> planes;
  FixedVector<ReportedPoint, kMaxLandmarks>
      points;  ///< firm ones first, most accurate first, then the others; no duplicates
};

}  // namespace swiftlet
