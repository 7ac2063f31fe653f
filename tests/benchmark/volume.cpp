// The volume beside Open3D's scalable TSDF volume: the same depth images, poses and voxels, one thread each,
// in one process and image by image in turn, so that a shared machine slows both alike.
//
// Open3D with a truncation distance of 0.2 m, where its completeness is that of the reference figures.

#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <vector>

#include "tests/benchmark/volume_open3d.hpp"
#include "tests/mapping/volume_run.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr double kOpen3dTruncation = 0.2;

std::array<double, 16> rowMajor(const SE3& T) {
  std::array<double, 16> matrix{};
  const Eigen::Matrix3d R = T.R();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) matrix[static_cast<std::size_t>(4 * r + c)] = R(r, c);
    matrix[static_cast<std::size_t>(4 * r + 3)] = T.translation[r];
  }
  matrix[15] = 1;
  return matrix;
}

struct Ours {
  explicit Ours(const DepthLog& log, bool labels) : with_labels(labels) {
    settings.labels = labels;
    volume = std::make_unique<VoxelVolume>(settings);
    integrator = std::make_unique<VolumeIntegrator>(*volume, log.camera.pixels());
  }
  void add(const DepthLog& log, std::size_t i) {
    DepthImageView image = log.view(i, with_labels);
    if (!with_labels) image.intensity = nullptr;
    VolumeStep step;
    ms.push_back(test::timed([&] { (void)integrator->step(image, log.frames[i].T_world_body, {}, step); }));
  }
  [[nodiscard]] TriangleMesh mesh() const {
    const ConfusionModel confusion;
    BlockSurface surface(*volume, confusion, {});
    const auto patch = std::make_unique<SurfacePatch>();
    MeshSink sink;
    for (std::uint32_t slot = 0; slot < volume->slots(); ++slot) {
      surface.extract(slot, *patch);
      if (!patch->triangles.empty()) sink.take(*patch);
    }
    return sink.mesh();
  }

  bool with_labels;
  VolumeSettings settings;
  std::unique_ptr<VoxelVolume> volume;
  std::unique_ptr<VolumeIntegrator> integrator;
  std::vector<double> ms;
};

void print(const char* who, const std::vector<double>& ms, double reference, const TriangleMesh& mesh,
           const TrueSurface& truth, const DepthLog& log) {
  const CompleteMeshAccuracy accuracy = completeMeshAccuracy(mesh, truth, log.observed);
  std::printf(
      "  %-22s %6.2f ms an image (%.2f of Open3D's, p99 %.2f), RMSE %.4f m, median %.4f, complete %.2f %%\n",
      who, meanOf(ms), meanOf(ms) / reference, percentileOf(ms, 0.99), accuracy.distance.rmse,
      accuracy.distance.median,
      100.0 * static_cast<double>(accuracy.covered) / static_cast<double>(accuracy.observed));
}

void compare(const std::string& folder) {
  const DepthLog log = readDepthLog(folder);
  const TrueSurface truth(log.truth);
  test::Open3dVolume open3d(
      0.05, kOpen3dTruncation,
      {log.camera.width, log.camera.height, log.camera.fx, log.camera.fy, log.camera.cx, log.camera.cy});
  Ours plain(log, false), labelled(log, true);
  std::vector<double> open3d_ms;
  for (std::size_t i = 0; i < log.frames.size(); ++i) {
    const SE3 T_camera_world = (log.frames[i].T_world_body * log.T_body_camera).inverse();
    open3d_ms.push_back(open3d.integrate(log.frames[i].depth, rowMajor(T_camera_world)));
    plain.add(log, i);
    labelled.add(log, i);
  }
  const test::Open3dMesh theirs = open3d.mesh();
  TriangleMesh mesh;
  for (const auto& p : theirs.vertices) mesh.vertices.emplace_back(p[0], p[1], p[2]);
  mesh.faces = theirs.faces;
  std::printf("%s, %zu depth images\n", log.name.c_str(), log.frames.size());
  const double reference = meanOf(open3d_ms);
  print("Open3D", open3d_ms, reference, mesh, truth, log);
  print("ours", plain.ms, reference, plain.mesh(), truth, log);
  print("ours, labels and grey", labelled.ms, reference, labelled.mesh(), truth, log);
}

}  // namespace

int main(int, char** argv) {
  // OpenMP reads this when the program starts, and Open3D asks OpenMP for all processors.
  if (std::getenv("OMP_NUM_THREADS") == nullptr) {
    setenv("OMP_NUM_THREADS", "1", 1);
    execv("/proc/self/exe", argv);
  }
  try {
    for (const char* name : {"vil_v102", "vil_mh05"}) {
      if (const auto folder = findDepthLog(name)) compare(*folder);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
