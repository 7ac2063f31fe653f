#pragma once
// A rolling shutter's depth image as all of it would be seen from where the camera was at the middle row.
//
// Each pixel of the result looks for the pixel that shows it: where a point at its depth was when that row
// was read, found in two rounds; the depth there, moved to the middle row's camera, is its own, with its
// sigma, grey value and label. Nearest pixel, no interpolation; what the motion uncovers has no depth. Rows
// are those of the raw image: a table, 4 bytes a pixel, and a second depth image beside the first, 10 bytes a
// pixel, reserved by the constructor. Cost: about 60 ns a pixel, one thread; nothing is allocated.
// docs/depth.md.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/messages/scan_motion.hpp"
#include "mapping/depth/depth_buffer.hpp"

namespace swiftlet {

class UnrolledDepth {
 public:
  /// `camera`, `T_body_camera`: the depth image's, at camera 0's place.
  UnrolledDepth(const Rig& rig, const PinholeIntrinsics& camera, const SE3& T_body_camera);

  /// In place.
  void apply(const ScanMotion& motion, DepthBuffer& depth);

 private:
  [[nodiscard]] Eigen::Vector3d rayAt(std::size_t x, std::size_t y) const;

  PinholeIntrinsics camera_;
  SE3 T_body_camera_;
  std::vector<float> row_time_;  ///< s
  DepthBuffer result_;
};

}  // namespace swiftlet
