#pragma once
// Converts the depth image of a rolling shutter to the camera's pose at the middle row.
//
// For each pixel of the result, two rounds find the source pixel that shows the same point: the point at the
// pixel's depth, moved to the time when the source pixel's row was read. The result takes the source's depth,
// transformed to the camera at the middle row, its sigma, grey value and label. Nearest pixel, no
// interpolation; pixels that the motion uncovers have no depth.
//
// The two cameras read the same rectified row some 0.3 ms apart, because rectified rows are not raw rows. The
// image moves by a tenth of a pixel in that time, and the disparity is corrected for it. Memory: 2 bytes a
// pixel for the raw rows and 10 bytes a pixel for a second depth image, allocated by the constructor. Cost:
// some 90 ns a pixel, one thread; no allocation. docs/depth.md.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/messages/camera_scan.hpp"
#include "mapping/depth/depth_buffer.hpp"
#include "mapping/depth/stereo_rectification.hpp"

namespace swiftlet {

class UnrolledDepth {
 public:
  /// `ideal` must have an ok status; depth images are of its camera 0.
  UnrolledDepth(const Rig& rig, const StereoRectification& ideal);

  /// Works in place.
  void apply(const ScanMotion& motion, DepthBuffer& depth);

 private:
  /// Bands of raw rows that share one pose: accurate to 0.1 ms of 20 ms, 0.05 px at 1 rad/s.
  static constexpr std::size_t kBands = 256;
  struct Band {
    double seconds = 0;  ///< after the middle row
    Eigen::Matrix3d R_middle_row;
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();  ///< of the camera since the middle row [m]
  };

  [[nodiscard]] std::vector<std::uint8_t> bandsOf(const Rig& rig, std::size_t c,
                                                  const Eigen::Matrix3d& R_cam_ideal) const;
  [[nodiscard]] Eigen::Vector3d rayAt(std::size_t x, std::size_t y) const;
  [[nodiscard]] double corrected(double z, std::size_t pixel, const CameraScan& scan) const;

  PinholeIntrinsics camera_;
  SE3 T_body_camera_;
  double baseline_;
  double readout_;  // s
  std::array<std::vector<std::uint8_t>, kMaxCameras> band_;
  std::array<Band, kBands> bands_;
  DepthBuffer result_;
};

}  // namespace swiftlet
