#include "drivers/simulated/camera_renderer.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "drivers/simulated/parallel.hpp"
#include "drivers/simulated/tile_tracer.hpp"

namespace swiftlet {
namespace {

constexpr int kMaxSamples = 8;
constexpr double kPixelsPerSample = 1.0;  // px of motion between samples
constexpr float kFullScale = 215.0F;      // stored texture value of radiance 1
constexpr float kMinCosine = 0.08F;       // limits the footprint of grazing rays

using Sample = CameraRenderer::Sample;

// Positions spread over the pixel with zero mean, so that the image is not shifted.
std::vector<Sample> samplePattern(int count) {
  constexpr std::array<std::array<float, 2>, 4> kRotatedGrid{
      {{-0.125F, -0.375F}, {0.375F, -0.125F}, {-0.375F, 0.125F}, {0.125F, 0.375F}}};
  std::vector<Sample> samples(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].instant = (static_cast<double>(i) + 0.5) / count - 0.5;
    if (count == 1) continue;
    samples[i].dx = kRotatedGrid[i % 4][0];
    samples[i].dy = kRotatedGrid[i % 4][1];
  }
  return samples;
}

// log2 with an error of 0.06: the level need not be exact.
float roughLog2(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const float mantissa = static_cast<float>(bits & 0x7FFFFFU) * 0x1p-23F;
  return static_cast<float>(static_cast<int>(bits >> 23U) - 127) + mantissa;
}

struct Shading {
  const TexturedWorld* world = nullptr;
  float pixel_angle = 0;
  float level_shift = 0;  // different for each sample, so that their mean blends two levels
};

void shadeTile(const Shading& shading, const View& view, const Tile& tile,
               std::array<float, kTilePixels>& sum) {
  for (int i = 0; i < kTilePixels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (tile.hit[k] < 0) continue;
    const ViewedPatch& patch = view.patches()[static_cast<std::size_t>(tile.hit[k])];
    const SurfaceHit hit = surfaceAt(patch, tile, i);
    const Texture& texture = shading.world->texture(patch.index);
    const float cosine = std::max(hit.cosine, kMinCosine);
    // Texels across the pixel, squared and averaged over both directions of the footprint.
    const float across = shading.pixel_angle * tile.distance[k] * texture.perMetre();
    const float level = 0.5F * roughLog2(across * across / cosine) + shading.level_shift;
    sum[k] += texture.sample(hit.u, hit.v, static_cast<int>(std::floor(level)));
  }
}

struct Grid {
  int columns = 0;
  int rows = 0;
};
Grid tileGrid(const RayTable& rays) {
  return {(rays.width() + kTileSide - 1) / kTileSide, (rays.height() + kTileSide - 1) / kTileSide};
}

void turnRows(const CameraRenderer::RowTurns& turns, Tile& tile) {
  for (std::size_t i = 0; i < turns.size() * kTileSide; ++i) {
    const Eigen::Vector3f ray = turns[i / kTileSide] * Eigen::Vector3f(tile.x[i], tile.y[i], tile.z[i]);
    tile.x[i] = ray.x();
    tile.y[i] = ray.y();
    tile.z[i] = ray.z();
  }
}

}  // namespace

// The camera's pose at each sample's instant around one time, for all rows or a band of them.
struct CameraRenderer::Instant {
  std::vector<View> views;
  View middle;
  float turn = 0;   // rad, during the exposure
  float slack = 0;  // m
};

CameraRenderer::CameraRenderer(const TexturedWorld& world, const CameraModel& camera, const SE3& T_body_cam)
    : world_(&world), camera_(camera), T_body_cam_(T_body_cam), rays_(camera) {}

CameraRenderer::Instant CameraRenderer::instantAt(const SplineTrajectory& trajectory, double seconds,
                                                  double exposure, std::span<const Sample> samples) const {
  const MotionState motion = trajectory.at(seconds);
  const double shift = speedOf(motion) * exposure;
  // All views keep the same patches, so that one list of candidates serves them all: `slack` also keeps
  // patches whose visible side faces the camera only during part of the exposure.
  const double slack = shift + 1e-3;
  Instant instant{{},
                  View(world_->world(), motion.T_world_body * T_body_cam_, slack),
                  static_cast<float>(motion.omega_body.norm() * exposure),
                  static_cast<float>(slack)};
  instant.views.reserve(samples.size());
  constexpr double kKeepAll = 1e9;
  for (const Sample& sample : samples) {
    const SE3 pose = trajectory.pose(seconds + sample.instant * exposure) * T_body_cam_;
    instant.views.emplace_back(world_->world(), pose, kKeepAll);
  }
  return instant;
}

double CameraRenderer::speedOf(const MotionState& motion) const {
  return motion.v_world_body.norm() + motion.omega_body.norm() * T_body_cam_.translation.norm();
}

void CameraRenderer::renderRows(const Instant& instant, std::span<const Sample> samples, int row, int rows,
                                const RowTurns* turns, std::vector<float>& radiance) const {
  const float scale = 1.0F / (kFullScale * static_cast<float>(samples.size()));
  Tile tile;
  std::vector<std::int32_t> candidates;
  for (int column = 0; column < rays_.width(); column += kTileSide) {
    patchesInTile(instant.middle, rays_, column, row, instant.turn, instant.slack, candidates);
    // Convert indices into the middle view to indices into the views with all patches.
    for (std::int32_t& id : candidates) {
      id = static_cast<std::int32_t>(instant.middle.patches()[static_cast<std::size_t>(id)].index);
    }
    std::array<float, kTilePixels> sum{};
    for (std::size_t s = 0; s < samples.size(); ++s) {
      loadRays(rays_, column, row, samples[s].dx, samples[s].dy, tile);
      if (turns != nullptr) turnRows(*turns, tile);
      traceTile(instant.views[s], candidates, tile);
      // A sample covers only a part of the pixel: use half a level finer than the pixel's footprint.
      const float blend = (static_cast<float>(s % 4) + 0.5F) / 4.0F;
      shadeTile({world_, rays_.pixelAngle(), blend - 0.5F}, instant.views[s], tile, sum);
    }
    const int width = std::min(kTileSide, rays_.width() - column);
    const int height = std::min(rows, rays_.height() - row);
    for (int j = 0; j < height; ++j) {
      float* out = radiance.data() + static_cast<std::ptrdiff_t>(row + j) * rays_.width() + column;
      for (int i = 0; i < width; ++i) out[i] = scale * sum[static_cast<std::size_t>(j * kTileSide + i)];
    }
  }
}

void CameraRenderer::renderImage(const SplineTrajectory& trajectory, double seconds,
                                 const RenderSettings& settings, std::vector<float>& radiance) const {
  const MotionState motion = trajectory.at(seconds);
  // Image motion [px] by rotation, and by translation relative to an object at one metre.
  const double moved = (motion.omega_body.norm() + speedOf(motion)) * settings.exposure * camera_.focal();
  const int count = settings.samples <= 1 ? 1 : moved > 4 * kPixelsPerSample ? kMaxSamples : 4;
  const std::vector<Sample> samples = samplePattern(count);
  radiance.assign(static_cast<std::size_t>(rays_.width()) * static_cast<std::size_t>(rays_.height()), 0.0F);
  if (settings.readout == 0) {
    const Instant all = instantAt(trajectory, seconds, settings.exposure, samples);
    parallelFor(tileGrid(rays_).rows, settings.threads, [&](int tile_row) {
      renderRows(all, samples, tile_row * kTileSide, kTileSide, nullptr, radiance);
    });
    return;
  }
  const auto timeOf = [&](double row) {
    return seconds + settings.readout * (row / (rays_.height() - 1) - 0.5);
  };
  parallelFor((rays_.height() + kBandRows - 1) / kBandRows, settings.threads, [&](int band) {
    const int row = band * kBandRows;
    const double middle = timeOf(row + 0.5 * (kBandRows - 1));
    const Instant instant = instantAt(trajectory, middle, settings.exposure, samples);
    const Eigen::Matrix3d R_cam_world = (trajectory.pose(middle) * T_body_cam_).R().transpose();
    RowTurns turns;
    for (int j = 0; j < kBandRows; ++j) {
      turns[static_cast<std::size_t>(j)] =
          (R_cam_world * (trajectory.pose(timeOf(row + j)) * T_body_cam_).R()).cast<float>();
    }
    renderRows(instant, samples, row, kBandRows, &turns, radiance);
  });
}

void CameraRenderer::renderGeometry(const SE3& T_world_body, int threads, GeometryImage& geometry) const {
  const auto pixels = static_cast<std::size_t>(rays_.width()) * static_cast<std::size_t>(rays_.height());
  geometry.depth.assign(pixels, 0.0F);
  geometry.label.assign(pixels, 0);
  geometry.patch.assign(pixels, -1);
  const View view(world_->world(), T_world_body * T_body_cam_, 0.0);
  const Grid grid = tileGrid(rays_);
  parallelFor(grid.rows, threads, [&](int tile_row) {
    Tile tile;
    std::vector<std::int32_t> candidates;
    for (int tile_column = 0; tile_column < grid.columns; ++tile_column) {
      const int column = tile_column * kTileSide;
      const int row = tile_row * kTileSide;
      patchesInTile(view, rays_, column, row, 0.0F, 0.0F, candidates);
      loadRays(rays_, column, row, 0.0F, 0.0F, tile);
      traceTile(view, candidates, tile);
      const int width = std::min(kTileSide, rays_.width() - column);
      const int height = std::min(kTileSide, rays_.height() - row);
      for (int j = 0; j < height; ++j) {
        for (int i = 0; i < width; ++i) {
          const auto k = static_cast<std::size_t>(j * kTileSide + i);
          if (tile.hit[k] < 0) continue;
          const auto out = static_cast<std::size_t>(row + j) * static_cast<std::size_t>(rays_.width()) +
                           static_cast<std::size_t>(column + i);
          const std::uint32_t patch = view.patches()[static_cast<std::size_t>(tile.hit[k])].index;
          geometry.depth[out] = tile.distance[k] * tile.z[k];
          geometry.patch[out] = static_cast<std::int32_t>(patch);
          geometry.label[out] = static_cast<std::uint8_t>(world_->world().patches()[patch].label);
        }
      }
    }
  });
}

}  // namespace swiftlet
