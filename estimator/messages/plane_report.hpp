#pragma once
// Planes that the mesher found, with the landmarks on them: on its way to the smoother, which ties them.
//
// A report holds all that is known, not what changed: a reader that skipped some misses nothing.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

enum class PlaneDirection : std::uint8_t {
  kHorizontal,  ///< a floor, a ceiling, a table: its normal is along z
  kVertical,    ///< a wall: its normal is orthogonal to z
};

/// n . p = distance, world.
struct ReportedPlane {
  std::uint64_t id = 0;  ///< from 1; never reused within an epoch
  PlaneDirection direction = PlaneDirection::kHorizontal;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, towards the side that was seen
  double distance = 0;                                ///< m
};

struct ReportedPoint {
  TrackId id = 0;
  std::uint64_t plane = 0;  ///< id of the plane that it lies on
  /// False: amid points of the plane, but known too badly to tell it from something in front: to be drawn on
  /// it, not to be tied.
  bool firm = true;
};

struct PlaneReport {
  std::uint32_t epoch = 0;
  Stamp stamp;                    ///< of the keyframe that it was found at
  std::uint64_t frame_index = 0;  ///< that keyframe's
  FixedVector<ReportedPlane, kMaxPlanes> planes;
  FixedVector<ReportedPoint, kMaxLandmarks>
      points;  ///< firm ones, best known first; then the others. Each once
};

}  // namespace swiftlet
