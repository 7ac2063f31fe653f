// Volume and surface over the logs with true depth; run by hand, prints figures.
//
//   volume_statistics [folder]    writes each mesh to folder/<log>.ply

#include <cstdio>
#include <exception>
#include <string>

#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "tests/mapping/volume_run.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr double kMega = 1 << 20;

void print(const char* what, const VolumeRun& run, const DepthLog& log, const TrueSurface& truth) {
  const CompleteMeshAccuracy mesh = completeMeshAccuracy(run.mesh, truth, log.observed);
  std::printf("%s, %s: RMSE %.4f m, median %.4f, 95 %% %.4f, complete %.2f %%, %zu faces\n", log.name.c_str(),
              what, mesh.distance.rmse, mesh.distance.median, mesh.distance.percentile95,
              100.0 * static_cast<double>(mesh.covered) / static_cast<double>(mesh.observed), mesh.faces);
  std::printf(
      "  integration %.2f ms an image (p99 %.2f), surface %.2f (p99 %.2f), %.0f blocks drawn an image\n",
      meanOf(run.integration_ms), percentileOf(run.integration_ms, 0.99), meanOf(run.surface_ms),
      percentileOf(run.surface_ms, 0.99),
      static_cast<double>(run.drawn) / static_cast<double>(log.frames.size()));
  std::printf(
      "  %zu of %zu blocks (most %zu), %zu free; volume %.1f MB, integrator %.1f MB, surface %.1f MB; "
      "evicted %llu, "
      "refused %llu, patches dropped %llu; body in known space %zu of %zu times\n",
      run.blocks, run.capacity, run.most_blocks, run.free_blocks,
      static_cast<double>(run.volume_bytes) / kMega, static_cast<double>(run.integrator_bytes) / kMega,
      static_cast<double>(run.surface_bytes) / kMega, static_cast<unsigned long long>(run.volume.evicted),
      static_cast<unsigned long long>(run.volume.refused), static_cast<unsigned long long>(run.store.dropped),
      run.body_known, log.frames.size());
}

void printLabels(const VolumeRun& run, const DepthLog& log, const TrueSurface& truth) {
  const LabelQuality labels = labelQuality(run.mesh, truth, log);
  std::printf("  labels: mIoU %.2f %%, accuracy %.2f %%;", 100 * labels.mean_iou, 100 * labels.accuracy);
  for (std::size_t i = 1; i < kLabelValues; ++i) {
    if (labels.pixel_share[i] >= 0.01) std::printf(" %zu: %.1f %%", i, 100 * labels.iou(i));
  }
  std::printf("\n");
}

void measure(const std::string& folder, const char* out) {
  const DepthLog log = readDepthLog(folder);
  const TrueSurface truth(log.truth);
  RunOptions plain;
  plain.settings.labels = false;
  print("plain", fuse(log, plain), log, truth);
  const VolumeRun labelled = fuse(log, RunOptions{});
  print("with labels and grey", labelled, log, truth);
  printLabels(labelled, log, truth);
  if (out != nullptr) writePly(std::string(out) + "/" + log.name + ".ply", labelled.mesh);
  // A pool of a tenth of the blocks that the log needs.
  RunOptions small;
  while (VoxelVolume::blocksFor(small.settings.memory_bytes, true) > labelled.most_blocks / 10) {
    small.settings.memory_bytes -= small.settings.memory_bytes / 64;
  }
  const VolumeRun evicting = fuse(log, small);
  print("a tenth of the pool", evicting, log, truth);
  printLabels(evicting, log, truth);
  if (out != nullptr) writePly(std::string(out) + "/" + log.name + "_tenth.ply", evicting.mesh);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    for (const char* name : {"vil_v102", "vil_mh05"}) {
      if (const auto folder = findDepthLog(name)) measure(*folder, argc > 1 ? argv[1] : nullptr);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
