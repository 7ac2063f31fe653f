// The distance field's update beside a textbook transform of the same window: true depth and poses of the vil
// logs, default window. The update reads the blocks that changed, finds the nearest surface cell of every
// cell, which one it is and how far the unknown is. The textbook's finds squared distances from cell to cell,
// given where surface is (Felzenszwalb, Huttenlocher, "Distance Transforms of Sampled Functions", Theory of
// Computing 8, 2012). CPU time of this thread, all in one process.
#include <cstdio>
#include <limits>
#include <vector>

#include "estimator/core/random.hpp"
#include "mapping/distance/volume_distance.hpp"
#include "mapping/volume/volume_integrator.hpp"
#include "tests/mapping/depth_log.hpp"
#include "tests/mapping/volume_run.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

/// Images between two textbook transforms.
constexpr std::size_t kPlainEvery = 5;
constexpr int kQueries = 100'000;

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

void measure(const std::string& folder) {
  const DepthLog log = readDepthLog(folder);
  VolumeSettings settings;
  settings.labels = false;
  VoxelVolume volume(settings);
  VolumeIntegrator integrator(volume, log.camera.pixels());
  DistanceField field;
  VolumeDistance distance(volume, field);
  PlainTransform plain(field.limits().cells);
  std::vector<double> update, transform;
  std::size_t behind = 0;
  VolumeStep fused;
  DistanceStep done;
  for (std::size_t i = 0; i < log.frames.size(); ++i) {
    const DepthFrame& frame = log.frames[i];
    const Eigen::Vector3d& vehicle = frame.T_world_body.translation;
    (void)integrator.step(log.view(i, false), frame.T_world_body, {}, fused);
    update.push_back(test::timed([&] { distance.step(frame.stamp, vehicle, {}, done); }));
    behind += done.caught_up ? 0U : 1U;
    if (i % kPlainEvery != kPlainEvery - 1) continue;
    std::size_t at = 0;
    const Eigen::Vector3i& n = field.limits().cells;
    for (int z = 0; z < n.z(); ++z) {
      for (int y = 0; y < n.y(); ++y) {
        for (int x = 0; x < n.x(); ++x) {
          const bool holds = field.holdsSurface(field.origin() + Eigen::Vector3i(x, y, z));
          plain.squared()[at++] = holds ? 0 : std::numeric_limits<float>::infinity();
        }
      }
    }
    transform.push_back(test::timed([&] { plain(); }));
  }
  Random random(1);
  double sum = 0;
  const double asked = test::timed([&] {
    for (int i = 0; i < kQueries; ++i) {
      const Eigen::Vector3d to(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-1, 1));
      sum += field.query(log.frames.back().T_world_body.translation + to).clearance();
    }
  });
  const double ms = meanOf(update);
  std::printf(
      "%s: update %.1f ms (p50 %.1f, p99 %.1f), textbook transform %.1f ms (p50 %.1f), update / that %.2f; "
      "blocks left after %zu of %zu images; query %.2f us (mean clearance %.2f m); %.1f bytes a cell\n",
      log.name.c_str(), ms, percentileOf(update, 0.5), percentileOf(update, 0.99), meanOf(transform),
      percentileOf(transform, 0.5), ms / meanOf(transform), behind, update.size(), 1e3 * asked / kQueries,
      sum / kQueries, static_cast<double>(field.bytes()) / static_cast<double>(field.limits().cells.prod()));
}

}  // namespace

int main() {
  for (const char* name : {"vil_v102", "vil_mh05"}) {
    if (const auto folder = findDepthLog(name)) measure(*folder);
  }
  return 0;
}
