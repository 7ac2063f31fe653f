#pragma once
// The stage of the thread `map`: images with poses to a volume, its labelled surface and a distance field.
//
// A step takes the images of one moment: those of the cameras or of a depth sensor, and optional labels.
// Depth comes from the sensor if it gives one, otherwise from the two cameras. Grey values and labels of
// camera 0 are brought to the pixels of the depth image. Then the volume is updated, the surface of changed
// blocks is drawn, and the distance field follows. `MapEffort` bounds each. If poses are corrected later,
// call correct(); stepCorrection() then returns blocks near the vehicle in bounded pieces (MapSubmaps).
// Blocks for which the volume has no room, and all blocks of past epochs, are in the storage, if there is
// one. Errors: kInvalidInput, counted, if nothing was mapped: no depth and no pair of images, a wrong size, a
// pose that is not finite or jumped (VolumeIntegrator), an epoch for which no submap is left.
// kCapacityReached: mapped in part. Frames: map (or the world of the given poses), body, metres. Memory:
// reserved by the constructor; nothing is allocated later. No clock, no randomness: same input, same bytes.

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "mapping/depth/depth_stage.hpp"
#include "mapping/depth/sensor_depth.hpp"
#include "mapping/depth/unrolled_depth.hpp"
#include "mapping/distance/volume_distance.hpp"
#include "mapping/map/map_settings.hpp"
#include "mapping/map/map_submaps.hpp"
#include "mapping/map/view_warp.hpp"
#include "mapping/surface/surface_stage.hpp"
#include "mapping/volume/volume_integrator.hpp"

namespace swiftlet {

struct MapInput {
  Stamp stamp;
  std::uint64_t frame = 0;  ///< identifies the moment in later corrections of poses
  std::uint32_t epoch = 0;
  SE3 T_map_body;
  ScanMotion scan;  ///< motion while the rows of a rolling shutter were read
  SE3 T_map_world;  ///< of the odometry's world, if its poses are corrected; otherwise identity
  std::array<ImageView, kMaxCameras> image;  ///< raw; empty if missing
  DepthImageView depth;                      ///< of a sensor; `depth` null: from the images
  ImageView labels;                          ///< in camera 0's raw geometry; empty if missing
};

struct MapEffort {
  DepthEffort depth;
  VolumeEffort volume;
  SurfaceEffort surface;
  DistanceEffort distance;
};

/// Result of one step.
struct MapReport {
  Stamp stamp;
  Status status;
  bool from_sensor = false;
  bool with_labels = false;
  VolumeStep volume;
  SurfaceStep surface;
  DistanceStep distance;
};

struct MapCounters {
  std::uint64_t taken = 0;
  std::uint64_t without_depth = 0;  ///< neither a depth image nor a pair of the right size
  std::uint64_t wrong_size = 0;     ///< labels or grey values of a wrong size: dropped, the depth is used
  std::uint64_t epochs = 0;
  std::uint64_t without_submap = 0;  ///< frames of an epoch that began when all submaps were used
};

/// The set of labels that a text such as "10,12" names, as bits. Empty if the text is not a list of labels
/// from 1 to 31.
std::optional<std::uint32_t> labelMask(std::string_view labels);

/// Settings of the volume of a map with these settings.
VolumeSettings volumeSettings(const MapSettings& settings);

class MapStage {
 public:
  /// An invalid list of moving labels counts as empty: check it first. `depth_sensor`: camera of the depth
  /// sensor, if there is one. `storage`: see StoredBlocks.
  MapStage(const Rig& rig, const MapSettings& settings, const DepthImageView* depth_sensor = nullptr,
           BlockStorage* storage = nullptr, MapPoses poses = MapPoses::kEstimated);

  /// Before the first step: replaces MapSettings::label_certainty.
  void setConfusion(const ConfusionModel& confusion) { confusion_ = confusion; }

  /// Calls measure(), integrate(), draw() and updateDistance().
  Status step(const MapInput& input, const MapEffort& effort, MapReport& report);

  /// Measures depth from the sensor or the pair, with grey values and labels. Resets the report.
  Status measure(const MapInput& input, const DepthEffort& effort, MapReport& report);
  /// Fuses the last measurement into the volume.
  Status integrate(const MapInput& input, const VolumeEffort& effort, MapReport& report);
  /// Draws the surface of changed blocks.
  Status draw(const Eigen::Vector3d& p_map_vehicle, const SurfaceEffort& effort, MapReport& report);
  /// The stamp of an image that was not taken: the distance is stale until a newer one is.
  void announce(Stamp newest) { distance_.announce(newest); }
  /// Updates the distance field from the volume.
  void updateDistance(const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort, MapReport& report);

  // Corrections of earlier poses (MapSubmaps).
  void correct(std::span<const WorldInMap> worlds) { submaps_.correct(worlds); }
  [[nodiscard]] bool isCorrecting() const { return submaps_.busy(); }
  void stepCorrection(const CorrectionEffort& effort, CorrectionStep& out) {
    submaps_.step(vehicle_, effort, out);
  }
  [[nodiscard]] const MapSubmaps& submaps() const { return submaps_; }
  [[nodiscard]] MapSubmaps& submaps() { return submaps_; }

  /// Draws all blocks that wait. Work is not bounded: for the end of a run.
  void drawRest();
  /// The surface of everything mapped in epochs for which `wanted` holds, at its corrected pose; without a
  /// storage only that of the volume. Work is not bounded: for the end of a run.
  void visitWholeSurface(const std::function<bool(std::uint32_t epoch)>& wanted, SurfaceSink& sink);
  /// The same as a volume (MapSubmaps::wholeVolume()).
  VoxelVolume wholeVolume(const std::function<bool(std::uint32_t epoch)>& wanted) {
    return submaps_.wholeVolume([&](const Submap& submap) { return wanted(submap.epoch); });
  }
  /// Continues a kept map, before the first step. `fill(volume, submaps)` puts its blocks into both. The next
  /// pose is not checked for a jump.
  template <typename Fill>
  void restore(std::uint32_t epoch, const Eigen::Vector3d& p_map_vehicle, const Fill& fill) {
    volume_.clear();
    store_.clear();
    submaps_.follow({{}, 0, epoch, {}, {}, {}});
    volume_.beginChange();
    fill(volume_, submaps_);
    resume(epoch, p_map_vehicle);
  }
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  /// Last position of the vehicle [m].
  [[nodiscard]] const Eigen::Vector3d& vehicle() const { return vehicle_; }

  /// Null if the rig has one camera.
  [[nodiscard]] const DepthStage* stereo() const { return pair_ ? &pair_->depth : nullptr; }
  [[nodiscard]] const DistanceField& distance() const { return distance_; }
  [[nodiscard]] const VoxelVolume& volume() const { return volume_; }
  [[nodiscard]] const VolumeIntegrator& integrator() const { return integrator_; }
  [[nodiscard]] const SurfaceStore& surface() const { return store_; }
  /// All patches in memory, ordered by block, each at the corrected pose of its submap.
  void visitSurface(SurfaceSink& sink);
  [[nodiscard]] const SurfaceSettings& surfaceSettings() const { return surface_settings_; }
  [[nodiscard]] const SurfaceStage& surfaceStage() const { return surface_; }
  [[nodiscard]] const MapCounters& counters() const { return counters_; }

 private:
  /// A depth sensor, with the correspondence of its pixels to those of camera 0.
  struct Sensor {
    Sensor(const DepthImageView& camera, const Rig& rig);
    SensorDepth depth;
    ViewWarp warp;
    DepthBuffer buffer;
  };
  /// Two cameras.
  struct Pair {
    explicit Pair(const Rig& rig);
    DepthStage depth;
    DepthBuffer buffer;
    std::optional<UnrolledDepth> unrolled;  ///< only for a rolling shutter
  };

  Status measureBySensor(const MapInput& input);
  Status measureByPair(const MapInput& input, const DepthEffort& effort);
  void beginEpoch(std::uint32_t epoch);
  void resume(std::uint32_t epoch, const Eigen::Vector3d& p_map_vehicle);

  Rig rig_;
  ConfusionModel confusion_;
  VoxelVolume volume_;
  std::unique_ptr<Sensor> sensor_;
  std::unique_ptr<Pair> pair_;
  const DepthBuffer* measured_ = nullptr;  ///< of the sensor or the pair
  VolumeIntegrator integrator_;
  SurfaceStore store_;
  SurfaceSettings surface_settings_;
  SurfaceStage surface_;
  DistanceField distance_;
  MapSubmaps submaps_;
  VolumeDistance volume_distance_;
  SurfacePatch patch_, moved_patch_;
  std::uint32_t epoch_ = 0;
  Eigen::Vector3d vehicle_ = Eigen::Vector3d::Zero();  ///< last position
  Stamp newest_;                                       ///< newest image in the volume
  MapCounters counters_;
};

}  // namespace swiftlet
