// A rolling shutter's depth image of a plane, moved to where its middle row was read.

#include <catch2/catch.hpp>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "mapping/depth/stereo_rectification.hpp"
#include "mapping/depth/unrolled_depth.hpp"
#include "tests/mapping/depth_scene.hpp"

using namespace swiftlet;

TEST_CASE("A rolling shutter's depth is moved to the middle row", "[depth]") {
  Rig rig = depth_scene::makeRig(CameraKind::kPinholeRadtan);
  rig.readout = Duration::fromMilliseconds(25);
  const StereoRectification ideal(rig);
  REQUIRE(ideal.status().ok());
  const PinholeIntrinsics camera = ideal.intrinsics();
  const SE3& T_body_camera = ideal.T_body_camera();
  const ScanMotion motion{{{0.4, 1.2, -1.5}, {0.4, 1.2, -1.5}}, {2, -1, 0.5}};
  const Eigen::Vector3d n = Eigen::Vector3d(1, 0.3, -0.2).normalized();  // body axes at the middle row
  constexpr double kOffset = 2.5;                                        // m: n . p = offset

  // Depth of the plane from a pixel, `seconds` after the middle row.
  const auto depthAt = [&](int x, int y, double seconds) {
    const SE3 T_body_then(motion.turn.at(seconds), seconds * motion.v_body);
    const SE3 T = T_body_then * T_body_camera;
    const Eigen::Vector3d ray((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
    return (kOffset - n.dot(T.translation)) / n.dot(T.rotation * ray);
  };
  DepthBuffer depth(camera);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const auto i = static_cast<std::size_t>(y * camera.width + x);
      Eigen::Vector2d raw;
      const Eigen::Vector3d ray((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
      if (!rig.camera[0].project(ideal.R_cam_rectified(0) * ray, raw)) continue;
      // As the pair measures it: the right camera sees the point when its own row is read.
      const double seconds = rig.rowTime(0, raw.y());
      const double z = depthAt(x, y, seconds);
      const SE3 T_body_then(motion.turn.at(seconds), seconds * motion.v_body);
      const Eigen::Vector3d p = T_body_then * T_body_camera * Eigen::Vector3d(z * ray);
      Eigen::Vector3d in_right = z * ray - Eigen::Vector3d(ideal.baseline(), 0, 0);
      for (int round = 0; round < 4; ++round) {
        if (!rig.camera[1].project(ideal.R_cam_rectified(1) * in_right, raw)) break;
        const double later = rig.rowTime(1, raw.y());
        const SE3 T_body_later(motion.turn.at(later), later * motion.v_body);
        in_right = (T_body_later * T_body_camera).inverse() * p - Eigen::Vector3d(ideal.baseline(), 0, 0);
      }
      const double disparity = x - camera.cx - camera.fx * in_right.x() / in_right.z();
      depth.depth[i] = static_cast<float>(camera.fx * ideal.baseline() / disparity);
      depth.labels[i] = 7;
    }
  }
  const auto error = [&](const DepthBuffer& image) {
    double largest = 0;
    int known = 0;
    for (int y = 20; y < camera.height - 20; ++y) {
      for (int x = 20; x < camera.width - 20; ++x) {
        const auto i = static_cast<std::size_t>(y * camera.width + x);
        if (!(image.depth[i] > 0)) continue;
        ++known;
        largest = std::max(largest, std::abs(static_cast<double>(image.depth[i]) / depthAt(x, y, 0) - 1));
      }
    }
    CHECK(known > 0.98 * (camera.width - 40) * (camera.height - 40));
    return largest;
  };
  CHECK(error(depth) > 0.015);
  UnrolledDepth unrolled(rig, ideal);
  unrolled.apply(motion, depth);
  CHECK(error(depth) < 0.01);  // half a pixel of a slanted plane, 0.1 ms between the cameras
  CHECK(depth.labels[static_cast<std::size_t>(camera.width * camera.height / 2)] == 7);

  const std::vector<float> before = depth.depth;
  unrolled.apply({}, depth);
  CHECK(depth.depth == before);
}
