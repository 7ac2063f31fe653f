#pragma once
// A rolling shutter's depth image as all of it would be seen from where the camera was at the middle row.
//
// Each pixel of the result looks for the pixel that shows it: where a point at its depth was when that row
// was read, found in two rounds; the depth there, moved to the middle row's camera, is its own, with its
// sigma, grey value and label. Nearest pixel, no interpolation; what the motion uncovers has no depth.
// Rectified rows are not raw ones: the two cameras read the same rectified row some 0.3 ms apart, in which
// the image moves by a tenth of a pixel. The disparity is put right by that. Memory: 2 bytes a pixel for the
// raw rows, and a second depth image beside the first, 10 bytes a pixel, by the constructor. Cost: some 90 ns
// a pixel, one thread; nothing is allocated. docs/depth.md.

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
  /// `ideal` can rectify; depth images are of its camera 0.
  UnrolledDepth(const Rig& rig, const StereoRectification& ideal);

  /// In place.
  void apply(const ScanMotion& motion, DepthBuffer& depth);

 private:
  /// Of the raw image's rows, so many at a time: to 0.1 ms of 20, 0.05 px at 1 rad/s.
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
