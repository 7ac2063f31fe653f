#pragma once
// The Gauss-Newton system of a landmark's point with the poses held fixed, for triangulation.
//
// Shapes: H is 3 x 3, g is 3 x 1, over two tangent coordinates of the bearing and the inverse depth.
// Views are gathered into vector lanes once and linearized several times.
// Memory: 8.3 KiB on the stack for the gathered views of a whole window. Cost: linear in the views.

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "estimator/smoother/view_lanes.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

struct PointSystem {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  double cost = 0;       ///< robust (RobustWeight)
  int views = 0;         ///< number of views with the point in front of the camera
  bool in_front = true;  ///< true if in front of all cameras
};

/// Gathers the views of a landmark at the current poses, which must outlive this object. Views beyond the
/// capacity of a window (full smoothing has no limit) are gathered again at each linearization.
class PointViews {
 public:
  PointViews(RigPoses poses, std::span<const Sighting> sightings);

  /// Residuals and Jacobians at `point`, whose basis is `basis`.
  [[nodiscard]] PointSystem linearize(const LandmarkPoint& point, const PointBasis& basis) const;
  /// Only the cost.
  [[nodiscard]] double cost(const LandmarkPoint& point) const;

 private:
  static constexpr std::size_t kCapacity = kMaxStates * kMaxCameras / lanes::kLanes;

  RigPoses poses_;
  std::span<const Sighting> rest_;  // not gathered
  std::size_t count_ = 0;
  lanes::ViewGroup groups_[kCapacity];
};

}  // namespace swiftlet
