#include "tests/benchmark/volume_open3d.hpp"

#include <omp.h>
#include <open3d/camera/PinholeCameraIntrinsic.h>
#include <open3d/geometry/Image.h>
#include <open3d/geometry/RGBDImage.h>
#include <open3d/geometry/TriangleMesh.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>
#include <Eigen/Core>

#include <cstring>

#include "tests/support/cpu_time.hpp"

namespace swiftlet::test {

namespace o3d = open3d;

struct Open3dVolume::Parts {
  Parts(double voxel, double truncation, const Camera& camera)
      : volume(voxel, truncation, o3d::pipelines::integration::TSDFVolumeColorType::NoColor),
        intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) {
    image.depth_.Prepare(camera.width, camera.height, 1, sizeof(float));
    image.color_.Prepare(camera.width, camera.height, 3, 1);
  }

  o3d::pipelines::integration::ScalableTSDFVolume volume;
  o3d::camera::PinholeCameraIntrinsic intrinsics;
  o3d::geometry::RGBDImage image;
};

Open3dVolume::Open3dVolume(double voxel, double truncation, const Camera& camera) {
  omp_set_num_threads(1);
  parts_ = std::make_unique<Parts>(voxel, truncation, camera);
}
Open3dVolume::~Open3dVolume() = default;

double Open3dVolume::integrate(const std::vector<float>& depth,
                               const std::array<double, 16>& T_camera_world) {
  std::memcpy(parts_->image.depth_.data_.data(), depth.data(), depth.size() * sizeof(float));
  Eigen::Matrix4d extrinsic;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) extrinsic(r, c) = T_camera_world[static_cast<std::size_t>(4 * r + c)];
  }
  return timed([&] { parts_->volume.Integrate(parts_->image, parts_->intrinsics, extrinsic); },
               CLOCK_PROCESS_CPUTIME_ID);
}

Open3dMesh Open3dVolume::mesh() const {
  const auto from = parts_->volume.ExtractTriangleMesh();
  Open3dMesh mesh;
  for (const Eigen::Vector3d& p : from->vertices_) {
    mesh.vertices.push_back(
        {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  }
  for (const Eigen::Vector3i& f : from->triangles_) {
    mesh.faces.push_back({static_cast<std::uint32_t>(f.x()), static_cast<std::uint32_t>(f.y()),
                          static_cast<std::uint32_t>(f.z())});
  }
  return mesh;
}

}  // namespace swiftlet::test
