#pragma once
// Depth images for the sets of images: read from files, or drawn from a mesh of the true surface.

#include <opencv2/core.hpp>
#include <string>

#include "estimator/geometry/se3.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet::loop_sets {

/// Of a 16-bit image in millimetres: float, m along z, 0 unknown.
cv::Mat depthInMetres(const std::string& path);

/// The same of a mesh, seen by a pinhole of fx, fy, cx, cy. Both sides of a triangle are seen.
cv::Mat drawDepth(const TriangleMesh& mesh, const SE3& T_cam_world, const Eigen::Vector4d& pinhole,
                  cv::Size size);

}  // namespace swiftlet::loop_sets
