#include "mapping/map/map_stage.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

// Two voxels of surface on each side are known without the noise of one image deciding where it ends.
constexpr double kTruncationVoxels = 3;
constexpr double kBehindVoxels = 2;

VolumeSettings volumeSettings(const MapSettings& settings) {
  VolumeSettings volume;
  volume.voxel_size = settings.voxel_size;
  volume.truncation = kTruncationVoxels * settings.voxel_size;
  volume.behind = kBehindVoxels * settings.voxel_size;
  volume.memory_bytes = static_cast<std::size_t>(settings.volume_mib) << 20U;
  volume.labels = settings.labels;
  volume.most_range = settings.most_range;
  volume.masked_labels = settings.masked_labels;
  return volume;
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

MapStage::DepthSide::DepthSide(const PinholeIntrinsics& camera, const SE3& T_body_camera, const Rig& rig)
    : warp(camera, rig.camera[0], rig.T_body_cam[0].inverse() * T_body_camera),
      grey(camera.pixels()),
      labels(camera.pixels()) {}

MapStage::MapStage(const Rig& rig, const MapSettings& settings, const DepthImageView* depth_sensor,
                   SurfaceSink* spill)
    : rig_(rig),
      confusion_(kLabelValues, static_cast<float>(settings.label_certainty)),
      volume_(volumeSettings(settings)),
      sensor_(depth_sensor == nullptr
                  ? nullptr
                  : std::make_unique<DepthSide>(depth_sensor->camera, depth_sensor->T_body_camera, rig)),
      integrator_(volume_, mostPixels(rig, depth_sensor)),
      store_(static_cast<std::size_t>(settings.surface_mib) << 20U, volume_.blockSize(), spill),
      surface_(volume_, confusion_, store_),
      distance_(distanceLimits(settings)),
      volume_distance_(volume_, distance_) {}

void MapStage::addViews(const MapInput& input, DepthSide& side, DepthImageView& depth, MapReport& report) {
  if (!input.image[0].empty() && depth.intensity == nullptr) {
    if (side.warp.apply(input.image[0], depth.depth, side.grey.data()).ok()) {
      depth.intensity = side.grey.data();
    } else {
      ++counters_.wrong_size;
    }
  }
  if (!input.labels.empty() && depth.labels == nullptr) {
    if (side.warp.apply(input.labels, depth.depth, side.labels.data()).ok()) {
      depth.labels = side.labels.data();
    } else {
      ++counters_.wrong_size;
    }
  }
  report.with_labels = depth.labels != nullptr;
}

Status MapStage::step(const MapInput& input, const MapEffort& effort, MapReport& report) {
  const Status taken = takeDepth(input, effort.volume, report);
  if (taken.code == StatusCode::kInvalidInput) return taken;
  const Status drawn = draw(input.T_map_body.translation, effort.surface, report);
  updateDistance(input.T_map_body.translation, effort.distance, report);
  return taken.ok() ? drawn : taken;
}

Status MapStage::takeDepth(const MapInput& input, const VolumeEffort& effort, MapReport& report) {
  report = {};
  report.stamp = input.stamp;
  DepthImageView depth = input.depth;
  if (depth.depth == nullptr || sensor_ == nullptr) {
    ++counters_.without_depth;
    return report.status = {StatusCode::kInvalidInput, "neither a depth image nor two images"};
  }
  report.from_sensor = true;
  addViews(input, *sensor_, depth, report);
  if (input.epoch != epoch_) beginEpoch(input.epoch);
  report.status = integrator_.step(depth, input.T_map_body, effort, report.volume);
  if (report.status.code != StatusCode::kInvalidInput) ++counters_.taken;
  return report.status;
}

void MapStage::beginEpoch(std::uint32_t epoch) {
  // The store keeps what is drawn: the rest of the old world first.
  SurfaceStep last;
  static_cast<void>(surface_.step(vehicle_.cast<float>(), {}, last));
  volume_.clear();
  surface_.drawAll();
  integrator_.restart();
  epoch_ = epoch;
  ++counters_.epochs;
}

Status MapStage::draw(const Eigen::Vector3d& p_map_vehicle, const SurfaceEffort& effort, MapReport& report) {
  vehicle_ = p_map_vehicle;
  return surface_.step(vehicle_.cast<float>(), effort, report.surface);
}

void MapStage::updateDistance(const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort,
                              MapReport& report) {
  volume_distance_.step(p_map_vehicle, effort, report.distance);
}

}  // namespace swiftlet
