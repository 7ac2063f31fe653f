// Keeping the distance field true to a volume, beside making it anew with every image: true depth and poses
// of the vil logs, default window. Anew in two ways: by the same code from nothing (the volume read, waves
// from all its surfaces), and by the plain exact transform over all cells of the window, given where surface
// is (Felzenszwalb, Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012),
// without parts of a cell. CPU time of this thread, all in one process.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <vector>

#include "mapping/distance/volume_distance.hpp"
#include "mapping/volume/volume_integrator.hpp"
#include "tests/mapping/depth_log.hpp"
#include "tests/mapping/volume_run.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

/// Images between two fields from nothing, which take long.
constexpr std::size_t kAnewEvery = 10;
constexpr DistanceEffort kAll{std::numeric_limits<std::size_t>::max(),
                              std::numeric_limits<std::size_t>::max()};

/// Squared distances along one line, in place.
class LineTransform {
 public:
  explicit LineTransform(int longest)
      : from_(static_cast<std::size_t>(longest)),
        vertex_(static_cast<std::size_t>(longest)),
        border_(static_cast<std::size_t>(longest) + 1) {}

  void operator()(float* line, std::size_t stride, int count) {
    for (int i = 0; i < count; ++i)
      from_[static_cast<std::size_t>(i)] = line[static_cast<std::size_t>(i) * stride];
    constexpr float kNever = std::numeric_limits<float>::infinity();
    std::size_t last = 0;
    bool any = false;
    for (int i = 0; i < count; ++i) {
      if (from_[static_cast<std::size_t>(i)] == kNever) continue;
      float at = -kNever;
      while (any && (at = meet(vertex_[last], i)) <= border_[last]) {
        if (last == 0) {
          any = false;
        } else {
          --last;
        }
      }
      last = any ? last + 1 : 0;
      vertex_[last] = i;
      border_[last] = any ? at : -kNever;
      any = true;
    }
    if (!any) return;
    border_[last + 1] = kNever;
    std::size_t k = 0;
    for (int i = 0; i < count; ++i) {
      while (border_[k + 1] < static_cast<float>(i)) ++k;
      const auto d = static_cast<float>(i - vertex_[k]);
      line[static_cast<std::size_t>(i) * stride] = d * d + from_[static_cast<std::size_t>(vertex_[k])];
    }
  }

 private:
  [[nodiscard]] float meet(int a, int b) const {
    const auto fa = static_cast<float>(a), fb = static_cast<float>(b);
    return (from_[static_cast<std::size_t>(b)] + fb * fb - from_[static_cast<std::size_t>(a)] - fa * fa) /
           (2 * (fb - fa));
  }
  std::vector<float> from_;
  std::vector<int> vertex_;
  std::vector<float> border_;
};

class PlainTransform {
 public:
  explicit PlainTransform(const Eigen::Vector3i& cells)
      : cells_(cells), line_(cells.maxCoeff()), squared_(static_cast<std::size_t>(cells.prod())) {}
  std::vector<float>& squared() { return squared_; }
  void operator()() {
    const auto nx = static_cast<std::size_t>(cells_.x()), ny = static_cast<std::size_t>(cells_.y()),
               nz = static_cast<std::size_t>(cells_.z());
    for (std::size_t z = 0; z < nz; ++z) {
      for (std::size_t y = 0; y < ny; ++y) line_(&squared_[(z * ny + y) * nx], 1, cells_.x());
      for (std::size_t x = 0; x < nx; ++x) line_(&squared_[z * ny * nx + x], nx, cells_.y());
    }
    for (std::size_t at = 0; at < nx * ny; ++at) line_(&squared_[at], nx * ny, cells_.z());
  }

 private:
  Eigen::Vector3i cells_;
  LineTransform line_;
  std::vector<float> squared_;
};

struct Difference {
  std::size_t cells = 0, half = 0;
  double sum = 0, most = 0;
};

double distanceOf(const DistanceField& field, const Eigen::Vector3i& cell) {
  const float squared = field.squaredDistance(cell);
  const double reach = field.limits().reach;
  return squared < 0 ? reach : std::min(std::sqrt(static_cast<double>(squared)), reach);
}

template <typename Visit>
void forCells(const DistanceField& field, const Visit& visit) {
  const Eigen::Vector3i& n = field.limits().cells;
  std::size_t at = 0;
  for (int z = 0; z < n.z(); ++z) {
    for (int y = 0; y < n.y(); ++y) {
      for (int x = 0; x < n.x(); ++x) visit(at++, Eigen::Vector3i(field.origin() + Eigen::Vector3i(x, y, z)));
    }
  }
}

void measure(const std::string& folder) {
  const DepthLog log = readDepthLog(folder);
  VolumeSettings settings;
  settings.labels = false;
  VoxelVolume volume(settings);
  VolumeIntegrator integrator(volume, log.camera.pixels());
  DistanceField kept, bounded;
  VolumeDistance keeper(volume, kept), bounded_keeper(volume, bounded);
  PlainTransform plain(kept.limits().cells);
  std::vector<double> update, step, anew, transform;
  double cells = 0, step_cells = 0;
  std::size_t behind = 0;
  Difference difference;
  VolumeStep fused;
  DistanceStep done;
  for (std::size_t i = 0; i < log.frames.size(); ++i) {
    const SE3& T = log.frames[i].T_world_body;
    (void)integrator.step(log.view(i, false), T, {}, fused);
    update.push_back(test::timed([&] { keeper.step(T.translation, kAll, done); }));
    cells += static_cast<double>(done.cells);
    step.push_back(test::timed([&] { bounded_keeper.step(T.translation, {}, done); }));
    step_cells += static_cast<double>(done.cells);
    behind += done.caught_up ? 0U : 1U;
    if (i % kAnewEvery != kAnewEvery - 1) continue;
    DistanceField fresh;
    VolumeDistance reader(volume, fresh);
    // To the very same window: a window follows in steps, from wherever it was.
    const Eigen::Vector3d middle = kept.centreOf(kept.origin() + kept.limits().cells / 2);
    fresh.follow(middle + Eigen::Vector3d::Constant(100));
    anew.push_back(test::timed([&] { reader.step(middle, kAll, done); }));
    forCells(fresh, [&](std::size_t /*at*/, const Eigen::Vector3i& cell) {
      const double off = std::abs(distanceOf(fresh, cell) - distanceOf(kept, cell));
      ++difference.cells;
      difference.sum += off;
      difference.half += off > 0.5 ? 1U : 0U;
      difference.most = std::max(difference.most, off);
    });
    forCells(kept, [&](std::size_t at, const Eigen::Vector3i& cell) {
      plain.squared()[at] = kept.holdsSurface(cell) ? 0 : std::numeric_limits<float>::infinity();
    });
    transform.push_back(test::timed([&] { plain(); }));
  }
  const double ms = meanOf(update);
  std::printf("%s: update %.1f ms an image (p50 %.1f, p99 %.1f), %.0f cells taken\n", log.name.c_str(), ms,
              percentileOf(update, 0.5), percentileOf(update, 0.99),
              cells / static_cast<double>(update.size()));
  std::printf(
      "  default effort: %.1f ms (p50 %.1f, p99 %.1f), %.0f cells taken, behind after %zu of %zu images\n",
      meanOf(step), percentileOf(step, 0.5), percentileOf(step, 0.99),
      step_cells / static_cast<double>(step.size()), behind, step.size());
  std::printf("  from nothing %.1f ms, update / that %.2f; plain transform %.1f ms, update / that %.2f\n",
              meanOf(anew), ms / meanOf(anew), meanOf(transform), ms / meanOf(transform));
  std::printf("  update against from nothing: mean %.4f cells, %.3f %% by more than half a cell, most %.2f\n",
              difference.sum / static_cast<double>(difference.cells),
              100.0 * static_cast<double>(difference.half) / static_cast<double>(difference.cells),
              difference.most);
}

}  // namespace

int main() {
  for (const char* name : {"vil_v102", "vil_mh05"}) {
    if (const auto folder = findDepthLog(name)) measure(*folder);
  }
  return 0;
}
