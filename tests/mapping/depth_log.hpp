#pragma once
// The depth and label images of a `vil_*` log with true poses, decoded into memory, and its true surface.
//
// Depth: metres along z of the ideal pinhole camera that depth0/sensor.yaml describes. Labels: moved from
// camera 0's raw (distorted) geometry into the depth camera's by the nearest pixel; grey likewise, from
// camera 0's image of the same stamp.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimator/messages/depth_image.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet::testing {

struct DepthFrame {
  Stamp stamp;
  SE3 T_world_body;
  std::vector<float> depth;
  std::vector<std::uint8_t> grey;
  std::vector<std::uint8_t> labels;
};

struct DepthLog {
  std::string name;
  PinholeIntrinsics camera;
  SE3 T_body_camera;
  std::vector<DepthFrame> frames;
  TriangleMesh truth;
  std::vector<Eigen::Vector3f> observed;

  [[nodiscard]] DepthImageView view(std::size_t i, bool with_labels = true) const;
};

/// The folder that SWIFTLET_DATA names, else ../shared/data beside the source tree; empty when the log is
/// not there.
std::optional<std::string> findDepthLog(const std::string& name);

/// Throws (InputError, std::runtime_error) where the log cannot be read.
DepthLog readDepthLog(const std::string& folder);

}  // namespace swiftlet::testing
