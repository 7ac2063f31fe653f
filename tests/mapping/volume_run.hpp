#pragma once
// A log's depth images through volume and surface, and the figures of the mesh that comes out.

#include <array>
#include <map>
#include <vector>

#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"
#include "mapping/surface/surface_stage.hpp"
#include "mapping/volume/volume_integrator.hpp"
#include "tests/mapping/depth_log.hpp"

namespace swiftlet::testing {

/// The newest patch of every block; what leaves the store and what is in it at the end.
class MeshSink : public SurfaceSink {
 public:
  void take(const SurfacePatch& patch) override;
  /// A face takes the label that most of its vertices have.
  [[nodiscard]] TriangleMesh mesh() const;

 private:
  struct Patch {
    std::vector<SurfaceVertex> vertices;
    std::vector<SurfaceTriangle> triangles;
  };
  std::map<BlockIndex, Patch> patches_;
};

struct VolumeRun {
  std::vector<double> integration_ms;  ///< CPU, each image
  std::vector<double> surface_ms;
  std::size_t blocks = 0, most_blocks = 0, capacity = 0, free_blocks = 0;
  std::size_t body_known = 0;  ///< images at whose body the volume knew the voxel before
  std::size_t volume_bytes = 0, integrator_bytes = 0, surface_bytes = 0;
  std::size_t drawn = 0;
  VolumeCounters volume;
  IntegratorCounters integrator;
  SurfaceStoreCounters store;
  TriangleMesh mesh;
};

struct RunOptions {
  VolumeSettings settings;
  SurfaceSettings surface{.least_weight = SurfaceSettings::kLeastSensorWeight, .most_step = 0};
  std::size_t surface_bytes = std::size_t{32} << 20U;
  VolumeEffort effort;
};

VolumeRun fuse(const DepthLog& log, const RunOptions& options);

double meanOf(const std::vector<double>& values);
double percentileOf(std::vector<double> values, double share);

struct LabelQuality {
  /// samples[said][true]
  std::array<std::array<std::size_t, kLabelValues>, kLabelValues> samples{};
  std::array<double, kLabelValues> pixel_share{};
  double accuracy = 0;
  double mean_iou = 0;  ///< over labels with at least 1 % of the pixels
  [[nodiscard]] double iou(std::size_t label) const;
};

LabelQuality labelQuality(const TriangleMesh& mesh, const TrueSurface& truth, const DepthLog& log);

}  // namespace swiftlet::testing
