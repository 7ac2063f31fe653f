#include "mapping/map/map_stage.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

namespace swiftlet {
namespace {

// Two voxels on each side of a surface are known, whatever the noise of a single image.
constexpr double kTruncationVoxels = 3;
constexpr double kBehindVoxels = 2;
/// VolumeSettings::most_sigma in truncation distances.
constexpr double kMostSigma = 2;

SurfaceSettings surfaceFor(bool has_sensor) {
  SurfaceSettings surface;
  if (has_sensor) surface.least_weight = SurfaceSettings::kLeastSensorWeight;
  return surface;
}

DistanceLimits distanceLimits(const MapSettings& settings) {
  DistanceLimits limits;
  limits.cell_size = settings.voxel_size;
  return limits;
}

std::size_t mostPixels(const Rig& rig, const DepthImageView* sensor) {
  const auto pixels =
      static_cast<std::size_t>(rig.camera[0].width()) * static_cast<std::size_t>(rig.camera[0].height());
  return sensor == nullptr ? pixels : std::max(pixels, sensor->camera.pixels());
}

}  // namespace

VolumeSettings volumeSettings(const MapSettings& settings) {
  VolumeSettings volume;
  volume.voxel_size = settings.voxel_size;
  volume.truncation = kTruncationVoxels * settings.voxel_size;
  volume.behind = kBehindVoxels * settings.voxel_size;
  volume.most_sigma = kMostSigma * volume.truncation;
  volume.memory_bytes = static_cast<std::size_t>(settings.volume_mib) << 20U;
  volume.labels = settings.labels;
  volume.most_range = settings.most_range;
  volume.masked_labels = labelMask(settings.moving_labels).value_or(0);
  return volume;
}

std::optional<std::uint32_t> labelMask(std::string_view labels) {
  std::uint32_t mask = 0;
  while (!labels.empty()) {
    const std::size_t comma = std::min(labels.find(','), labels.size());
    int label = 0;
    const auto [end, error] = std::from_chars(labels.data(), labels.data() + comma, label);
    if (error != std::errc() || end != labels.data() + comma || label < 1 || label >= kLabelValues)
      return std::nullopt;
    mask |= 1U << static_cast<unsigned>(label);
    labels.remove_prefix(comma == labels.size() ? comma : comma + 1);
  }
  return mask;
}

MapStage::Sensor::Sensor(const DepthImageView& camera, const Rig& rig)
    : depth(camera.camera, camera.T_body_camera),
      warp(camera.camera, rig.camera[0], rig.T_body_cam[0].inverse() * camera.T_body_camera),
      buffer(depth.makeBuffer()) {}

MapStage::Pair::Pair(const Rig& rig) : depth(rig), buffer(depth.makeBuffer()) {
  if (rig.rolls() && depth.status().ok()) unrolled.emplace(rig, depth.rectification());
}

MapStage::MapStage(const Rig& rig, const MapSettings& settings, const DepthImageView* depth_sensor,
                   BlockStorage* storage, MapPoses poses)
    : rig_(rig),
      confusion_(kLabelValues, static_cast<float>(settings.label_certainty)),
      volume_(volumeSettings(settings)),
      sensor_(depth_sensor == nullptr ? nullptr : std::make_unique<Sensor>(*depth_sensor, rig)),
      pair_(rig.camera_count < 2 ? nullptr : std::make_unique<Pair>(rig)),
      integrator_(volume_, mostPixels(rig, depth_sensor)),
      store_(static_cast<std::size_t>(settings.surface_mib) << 20U, volume_.blockSize()),
      surface_settings_(surfaceFor(depth_sensor != nullptr)),
      surface_(volume_, confusion_, store_, surface_settings_),
      distance_(distanceLimits(settings)),
      submaps_(volume_, storage, poses,
               0.5 * distance_.limits().cell_size * distance_.limits().cells.cast<double>()),
      volume_distance_(volume_, distance_) {
  if (storage != nullptr) integrator_.setOverflow(&submaps_);
}

Status MapStage::step(const MapInput& input, const MapEffort& effort, MapReport& report) {
  if (!measure(input, effort.depth, report).ok()) return report.status;
  const Status taken = integrate(input, effort.volume, report);
  if (taken.code == StatusCode::kInvalidInput) return taken;
  const Status drawn = draw(input.T_map_body.translation, effort.surface, report);
  updateDistance(input.T_map_body.translation, effort.distance, report);
  return taken.ok() ? drawn : taken;
}

Status MapStage::measure(const MapInput& input, const DepthEffort& effort, MapReport& report) {
  report = {};
  report.stamp = input.stamp;
  measured_ = nullptr;
  report.from_sensor = input.depth.depth != nullptr && sensor_ != nullptr;
  report.status = report.from_sensor ? measureBySensor(input) : measureByPair(input, effort);
  if (!report.status.ok()) {
    ++counters_.without_depth;
    return report.status;
  }
  measured_ = report.from_sensor ? &sensor_->buffer : &pair_->buffer;
  report.with_labels = measured_->has_labels;
  return report.status;
}

Status MapStage::measureBySensor(const MapInput& input) {
  Sensor& sensor = *sensor_;
  DepthBuffer& out = sensor.buffer;
  const int width = input.depth.camera.width;
  const Status status =
      sensor.depth.step(input.depth.depth, width, input.depth.camera.height, width, input.stamp, out);
  if (!status.ok()) return status;
  const auto bring = [&](const ImageView& image, std::vector<std::uint8_t>& to) {
    if (image.empty()) return false;
    const bool fits = sensor.warp.apply(image, out.depth.data(), to.data()).ok();
    if (!fits) ++counters_.wrong_size;
    return fits;
  };
  out.has_intensity = bring(input.image[0], out.intensity);
  out.has_labels = bring(input.labels, out.labels);
  return status;
}

Status MapStage::measureByPair(const MapInput& input, const DepthEffort& effort) {
  if (pair_ == nullptr) return {StatusCode::kInvalidInput, "neither a depth image nor two cameras"};
  const Status status = pair_->depth.step(input.image[0], input.image[1], input.stamp, effort, pair_->buffer);
  if (status.ok() && !input.labels.empty() && !pair_->depth.addLabels(input.labels, pair_->buffer).ok()) {
    ++counters_.wrong_size;
  }
  if (status.ok() && pair_->unrolled) pair_->unrolled->apply(input.scan, pair_->buffer);
  return status;
}

Status MapStage::integrate(const MapInput& input, const VolumeEffort& effort, MapReport& report) {
  if (measured_ == nullptr) return report.status = {StatusCode::kInvalidInput, "nothing was measured"};
  if (input.epoch != epoch_) beginEpoch(input.epoch);
  report.status = integrator_.accept(measured_->view(), input.T_map_body);
  if (!report.status.ok()) return report.status;
  const SE3 T_world_body = input.T_map_world.inverse() * input.T_map_body;
  if (!submaps_.follow(
          {input.stamp, input.frame, input.epoch, T_world_body, input.T_map_world, input.T_map_world})) {
    ++counters_.without_submap;
    return report.status = {StatusCode::kInvalidInput,
                            "the map is full: frames of this epoch are not mapped"};
  }
  report.status = integrator_.fuse(measured_->view(), input.T_map_body, effort, report.volume);
  if (report.status.code == StatusCode::kInvalidInput) return report.status;
  ++counters_.taken;
  newest_ = input.stamp;
  return report.status;
}

void MapStage::beginEpoch(std::uint32_t epoch) {
  submaps_.storeAll();
  volume_.clear();
  store_.clear();
  surface_.drawAll();
  integrator_.restart();
  epoch_ = epoch;
  ++counters_.epochs;
}

void MapStage::drawRest() {
  SurfaceStep last;
  static_cast<void>(surface_.step(vehicle_.cast<float>(), kAllSurface, last));
}

void MapStage::resume(std::uint32_t epoch, const Eigen::Vector3d& p_map_vehicle) {
  integrator_.restart();
  epoch_ = epoch;
  vehicle_ = p_map_vehicle;
  surface_.drawAll();
  drawRest();
}

void MapStage::visitSurface(SurfaceSink& sink) {
  struct Moved : SurfaceSink {
    Moved(const Submaps& s, SurfaceSink& t, SurfacePatch& p) : submaps(s), to(t), patch(p) {}
    void take(const SurfacePatch& from) override {
      const Submap* const submap = from.submap < submaps.size() ? &submaps[from.submap] : nullptr;
      if (submap == nullptr || !submap->hasMoved()) {
        to.take(from);
        return;
      }
      patch = from;
      const SE3 motion = submap->motion();
      for (SurfaceVertex& vertex : patch.vertices)
        vertex.p_world = (motion * vertex.p_world.cast<double>()).cast<float>();
      to.take(patch);
    }
    const Submaps& submaps;
    SurfaceSink& to;
    SurfacePatch& patch;
  } moved(submaps_.submaps(), sink, moved_patch_);
  store_.visit(moved, patch_);
}

void MapStage::visitWholeSurface(const std::function<bool(std::uint32_t epoch)>& wanted, SurfaceSink& sink) {
  const VoxelVolume* drawn = nullptr;
  std::optional<BlockSurface> surface;
  submaps_.visitWhole([&](const Submap& submap) { return wanted(submap.epoch); },
                      [&](const VoxelVolume& volume, std::span<const std::uint32_t> slots) {
                        if (std::exchange(drawn, &volume) != &volume)
                          surface.emplace(volume, confusion_, surface_settings_);
                        for (const std::uint32_t slot : slots) {
                          surface->extract(slot, patch_);
                          if (!patch_.triangles.empty()) sink.take(patch_);
                        }
                      });
}

Status MapStage::draw(const Eigen::Vector3d& p_map_vehicle, const SurfaceEffort& effort, MapReport& report) {
  vehicle_ = p_map_vehicle;
  return surface_.step(vehicle_.cast<float>(), effort, report.surface);
}

void MapStage::updateDistance(const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
                              MapReport& report) {
  volume_distance_.step(newest_, p_map_vehicle, effort, report.distance);
}

}  // namespace swiftlet
