// Real depth images with poses (7-Scenes' RedKitchen): what the volume made of one half of them agrees with
// the other half, which it has not seen. Skipped where the data are not there.

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "mapping/surface/surface_stage.hpp"
#include "mapping/volume/volume_integrator.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;

namespace {

constexpr PinholeIntrinsics kCamera{585, 585, 320, 240, 640, 480};
constexpr std::uint16_t kInvalid = 65535;  // as 0

struct Frame {
  int number = 0;
  SE3 T_world_camera;
};

std::vector<Frame> framesOf(const std::string& folder) {
  std::ifstream file(folder + "/poses_c2w.txt");
  std::vector<Frame> frames;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream fields(line);
    Frame frame;
    Eigen::Vector3d p;
    Eigen::Vector4d q;
    REQUIRE(fields >> frame.number >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w());
    frame.T_world_camera = SE3(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), p);
    frames.push_back(frame);
  }
  return frames;
}

std::vector<float> depthOf(const std::string& folder, int number) {
  char name[40];
  std::snprintf(name, sizeof(name), "/depth/frame-%06d.png", number);
  const std::vector<std::uint8_t> bytes = test::bytesOf(folder + name);
  std::vector<std::uint16_t> units(kCamera.pixels());
  ImageSize found;
  REQUIRE(ImageDecoder::decode16(bytes, {kCamera.width, kCamera.height}, units.data(), found) ==
          DecodeResult::kOk);
  std::vector<float> depth(units.size());
  for (std::size_t i = 0; i < units.size(); ++i) {
    depth[i] = units[i] == kInvalid ? 0.0F : 1e-3F * static_cast<float>(units[i]);
  }
  return depth;
}

}  // namespace

TEST_CASE("half of a real sequence predicts the other half's depth") {
  const auto folder = findLog("rgbd_7scenes_100");
  if (!folder) {
    skipCase("no rgbd_7scenes_100 in the folder of logs", kRunWithData);
    return;
  }
  const std::vector<Frame> frames = framesOf(*folder);
  REQUIRE(frames.size() == 100);
  VolumeSettings settings;
  // Kinect's of the first kind (Nguyen, Izadi, Lovell, 3DIMPVT 2012), as SensorDepth's.
  settings.sigma_constant = 0.0012;
  settings.sigma_quadratic = 0.0019;
  VoxelVolume volume(settings);
  VolumeIntegrator integrator(volume, kCamera.pixels());
  std::size_t near = 0, close = 0, seen = 0;
  const auto view = [&](std::size_t i, const std::vector<float>& depth) {
    DepthImageView image;
    image.stamp = Stamp{static_cast<std::int64_t>(i + 1) * 33'000'000};
    image.camera = kCamera;
    image.depth = depth.data();
    return image;
  };
  VolumeStep step;
  for (std::size_t i = 0; i < frames.size(); i += 2) {
    const std::vector<float> depth = depthOf(*folder, frames[i].number);
    REQUIRE(integrator.step(view(i, depth), frames[i].T_world_camera, {}, step).ok());
  }
  CHECK(integrator.counters().pixels.unmeasured > 1000);  // it is real
  for (std::size_t i = 1; i < frames.size(); i += 2) {
    const std::vector<float> depth = depthOf(*folder, frames[i].number);
    for (int v = 4; v < kCamera.height; v += 8) {
      for (int u = 4; u < kCamera.width; u += 8) {
        const auto z = static_cast<double>(depth[static_cast<std::size_t>(v * kCamera.width + u)]);
        if (z < 0.4 || z > 3.5) continue;
        const Eigen::Vector3d p =
            frames[i].T_world_camera *
            Eigen::Vector3d((u - kCamera.cx) / kCamera.fx * z, (v - kCamera.cy) / kCamera.fy * z, z);
        float distance = 0;
        if (!volume.distanceAt(volume.voxelAt(p), distance)) continue;
        // Of the voxel's centre: half a voxel's diagonal more.
        ++seen;
        near += std::abs(distance) < 0.05F ? 1 : 0;
        close += std::abs(distance) < 0.025F ? 1 : 0;
      }
    }
  }
  CAPTURE(seen, near, close);
  REQUIRE(seen > 100'000);
  CHECK(static_cast<double>(near) > 0.95 * static_cast<double>(seen));
  CHECK(static_cast<double>(close) > 0.7 * static_cast<double>(seen));
}
