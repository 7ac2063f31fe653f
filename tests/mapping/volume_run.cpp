#include "tests/mapping/volume_run.hpp"

#include <algorithm>
#include <memory>
#include <numeric>

#include "tests/support/cpu_time.hpp"

namespace swiftlet::testing {

void MeshSink::take(const SurfacePatch& patch) {
  patches_[patch.block] = {{patch.vertices.begin(), patch.vertices.end()},
                           {patch.triangles.begin(), patch.triangles.end()}};
}

TriangleMesh MeshSink::mesh() const {
  TriangleMesh mesh;
  for (const auto& [block, patch] : patches_) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const SurfaceVertex& v : patch.vertices) {
      mesh.vertices.push_back(v.p_world);
      mesh.grey.push_back(v.grey);
    }
    for (const SurfaceTriangle& t : patch.triangles) {
      mesh.faces.push_back(std::array<std::uint32_t, 3>{first + t[0], first + t[1], first + t[2]});
      const std::uint8_t a = patch.vertices[t[0]].label, b = patch.vertices[t[1]].label,
                         c = patch.vertices[t[2]].label;
      mesh.labels.push_back(b == c ? b : a);
    }
  }
  return mesh;
}

VolumeRun fuse(const DepthLog& log, const RunOptions& options) {
  VolumeRun run;
  VoxelVolume volume(options.settings);
  VolumeIntegrator integrator(volume, log.camera.pixels());
  const ConfusionModel confusion;
  MeshSink sink;
  SurfaceStore store(options.surface_bytes, options.settings.voxel_size * kBlockSide);
  const auto stage = std::make_unique<SurfaceStage>(volume, confusion, store, options.surface);
  for (std::size_t i = 0; i < log.frames.size(); ++i) {
    const SE3& T = log.frames[i].T_world_body;
    DepthImageView image = log.view(i, options.settings.labels);
    if (!options.settings.labels) image.intensity = nullptr;
    VolumeStep fused;
    SurfaceStep drawn;
    float unused = 0;
    run.body_known += volume.distanceAt(volume.voxelAt(T.translation), unused) ? 1U : 0U;
    run.integration_ms.push_back(
        test::timed([&] { (void)integrator.step(image, T, options.effort, fused); }));
    run.surface_ms.push_back(test::timed([&] { (void)stage->step(T.translation.cast<float>(), {}, drawn); }));
    run.drawn += drawn.drawn;
    run.most_blocks = std::max(run.most_blocks, volume.blockCount());
  }
  SurfaceStep rest;
  (void)stage->step(log.frames.back().T_world_body.translation.cast<float>(), kAllSurface, rest);
  const auto patch = std::make_unique<SurfacePatch>();
  store.visit(sink, *patch);
  run.mesh = sink.mesh();
  run.blocks = volume.blockCount();
  run.capacity = volume.blockCapacity();
  run.free_blocks = volume.freeCount();
  run.volume_bytes = volume.bytes();
  run.integrator_bytes = integrator.bytes();
  run.surface_bytes = store.bytes() + stage->bytes();
  run.volume = volume.counters();
  run.integrator = integrator.counters();
  run.store = store.counters();
  return run;
}

double meanOf(const std::vector<double>& values) {
  return values.empty()
             ? 0
             : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double percentileOf(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

double LabelQuality::iou(std::size_t label) const {
  std::size_t said = 0, real = 0;
  for (std::size_t i = 0; i < kLabelValues; ++i) {
    said += samples[label][i];
    real += samples[i][label];
  }
  const std::size_t right = samples[label][label];
  return said + real > right ? static_cast<double>(right) / static_cast<double>(said + real - right) : 0;
}

LabelQuality labelQuality(const TriangleMesh& mesh, const TrueSurface& truth, const DepthLog& log) {
  LabelQuality quality;
  for (const SurfaceSample& sample : sampleSurface(mesh, kSurfaceDensity)) {
    const auto nearest = truth.distance().nearest(sample.point);
    if (!nearest) continue;
    ++quality.samples[mesh.labels[sample.face] % kLabelValues][truth.label(nearest->face) % kLabelValues];
  }
  double pixels = 0;
  for (const DepthFrame& frame : log.frames) {
    for (const std::uint8_t label : frame.labels) quality.pixel_share[label % kLabelValues] += 1;
    pixels += static_cast<double>(frame.labels.size());
  }
  double right = 0, all = 0;
  int judged = 0;
  for (std::size_t label = 1; label < kLabelValues; ++label) {
    quality.pixel_share[label] /= std::max(pixels, 1.0);
    right += static_cast<double>(quality.samples[label][label]);
    for (std::size_t said = 0; said < kLabelValues; ++said)
      all += static_cast<double>(quality.samples[said][label]);
    if (quality.pixel_share[label] < 0.01) continue;
    quality.mean_iou += quality.iou(label);
    ++judged;
  }
  quality.mean_iou /= std::max(judged, 1);
  quality.accuracy = all > 0 ? right / all : 0;
  return quality;
}

}  // namespace swiftlet::testing
