#pragma once
// Open3D's scalable TSDF volume behind plain types. Debian builds it for baseline x86-64, where Eigen aligns
// to 16 bytes: it lives in a library of its own, built alike, so that no Eigen code of the two mixes.

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace swiftlet::test {

struct Open3dMesh {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

class Open3dVolume {
 public:
  struct Camera {
    int width = 0, height = 0;
    double fx = 0, fy = 0, cx = 0, cy = 0;
  };

  Open3dVolume(double voxel, double truncation, const Camera& camera);
  ~Open3dVolume();
  Open3dVolume(const Open3dVolume&) = delete;
  Open3dVolume& operator=(const Open3dVolume&) = delete;

  /// `depth` [m]; `T_camera_world` row-major 4 x 4. Gives the CPU time of the whole process [ms] that
  /// Integrate() itself took.
  double integrate(const std::vector<float>& depth, const std::array<double, 16>& T_camera_world);
  Open3dMesh mesh() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace swiftlet::test
