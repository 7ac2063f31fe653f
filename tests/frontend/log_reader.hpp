#pragma once
// A small reader of EuRoC folders for the front-end's tests and tools: calibration, stamps, images
// (jpg, png), truth and gyro. Not robust on purpose: drivers/recorded is; this one has no
// dependency on it, so that the room can be tested alone.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet::testing {

struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
};

struct DepthImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> millimetres;
};

struct TruthPose {
  std::int64_t stamp = 0;
  SE3 T_world_body;
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();
};

struct GyroSample {
  std::int64_t stamp = 0;
  Eigen::Vector3d rate;
};

struct EurocLog {
  std::string folder;
  Rig rig;
  std::vector<std::int64_t> stamps;  ///< of images that both cameras have
  std::vector<TruthPose> truth;
  std::vector<GyroSample> gyro;

  /// Empty vectors where the folder does not exist.
  static EurocLog open(const std::string& folder);
  [[nodiscard]] GreyImage image(std::size_t camera, std::int64_t stamp) const;
  /// Zero-sized when there is none at that stamp.
  [[nodiscard]] DepthImage depth(std::int64_t stamp) const;
  /// Truth by interpolation; false outside of it.
  [[nodiscard]] bool pose(std::int64_t stamp, SE3& T_world_body) const;
  /// R_a_b from the gyro with a constant bias removed.
  [[nodiscard]] Eigen::Quaterniond rotation(std::int64_t from, std::int64_t to,
                                            const Eigen::Vector3d& bias) const;
};

/// Folder of the logs: SWIFTLET_DATA, else ../shared/data beside the source tree.
std::string dataFolder();

}  // namespace swiftlet::testing
