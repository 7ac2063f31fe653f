#pragma once
// The stage of the thread `map`: images with poses to a volume, its labelled surface and a distance field.
//
// A step takes one moment: the images of the cameras, or the depth image of a sensor, and labels where there
// are any. Depth comes from the sensor when it gives one, else from the two cameras. Grey values and labels
// are brought from camera 0 to the depth's pixels. Then the volume takes the depth, the surface follows the
// blocks that changed, the distance field follows the volume. `MapEffort` bounds each. Where poses turn out
// otherwise later, correct() says so, and stepCorrection() brings back bit by bit what lies near
// (MapSubmaps). What the volume has no room for, and all of an epoch that is over, is in the storage, if
// there is one. Errors: kInvalidInput, counted, where nothing could be taken: no depth and no pair of images,
// a wrong size, a pose that is not finite or jumped (VolumeIntegrator). kCapacityReached: taken, in part.
// Frames: map (or world, of whoever gives the poses), body, metres. Memory: all reserved by the constructor
// (bytes() says how much); nothing is allocated later. No clock, no randomness: same input, same bytes.

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
  std::uint64_t frame = 0;  ///< names the moment where poses are corrected later
  std::uint32_t epoch = 0;
  SE3 T_map_body;
  ScanMotion scan;  ///< while a rolling shutter's rows were read
  SE3 T_map_world;  ///< of the odometry's world, whoever corrects its poses; otherwise left alone
  std::array<ImageView, kMaxCameras> image;  ///< raw; empty where missing
  DepthImageView depth;                      ///< of a sensor; `depth` null: from the images
  ImageView labels;                          ///< in camera 0's raw geometry; empty where missing
};

struct MapEffort {
  DepthEffort depth;
  VolumeEffort volume;
  SurfaceEffort surface;
  DistanceEffort distance;
};

/// What one step did.
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
  std::uint64_t without_depth = 0;  ///< neither a depth image nor a pair, or none that fits the camera
  std::uint64_t wrong_size = 0;     ///< labels or grey values that do not fit: left out, the depth is taken
  std::uint64_t epochs = 0;
};

/// The set of labels that "10,12" names, bit by bit; empty where the text is no such list of labels from 1
/// to 31.
std::optional<std::uint32_t> labelMask(std::string_view labels);

class MapStage {
 public:
  /// Moving labels that are no list count as none: check them first. `depth_sensor`: its camera, where one
  /// gives depth images. `storage`: StoredBlocks.
  MapStage(const Rig& rig, const MapSettings& settings, const DepthImageView* depth_sensor = nullptr,
           BlockStorage* storage = nullptr, MapPoses poses = MapPoses::kEstimated);

  /// Before the first step: in place of MapSettings::label_certainty.
  void setConfusion(const ConfusionModel& confusion) { confusion_ = confusion; }

  /// All of the below, in their order.
  Status step(const MapInput& input, const MapEffort& effort, MapReport& report);

  /// Depth of this moment, from the sensor or the pair, with grey values and labels. The report begins here.
  Status measure(const MapInput& input, const DepthEffort& effort, MapReport& report);
  /// What was measured last, into the volume.
  Status integrate(const MapInput& input, const VolumeEffort& effort, MapReport& report);
  /// The surface of what changed.
  Status draw(const Eigen::Vector3d& p_map_vehicle, const SurfaceEffort& effort, MapReport& report);
  /// The field takes what `integrate` gave up to now.
  void updateDistance(const Eigen::Vector3d& p_map_vehicle, const DistanceEffort& effort, MapReport& report);

  // Corrections of what was integrated before: MapSubmaps'.
  void correct(std::span<const WorldInMap> worlds) { submaps_.correct(worlds); }
  [[nodiscard]] bool isCorrecting() const { return submaps_.busy(); }
  void stepCorrection(const CorrectionEffort& effort, CorrectionStep& out) {
    submaps_.step(vehicle_, effort, out);
  }
  [[nodiscard]] const MapSubmaps& submaps() const { return submaps_; }
  [[nodiscard]] MapSubmaps& submaps() { return submaps_; }

  /// Draws all that waits: work without a bound, for the end of a run.
  void drawRest();
  /// The surface of all that was ever mapped in epochs for which `wanted` holds, where it belongs by now; of
  /// the volume alone where there is no storage. Work without a bound, for the end of a run.
  void visitWholeSurface(const std::function<bool(std::uint32_t epoch)>& wanted, SurfaceSink& sink);
  /// The same as a volume: MapSubmaps::wholeVolume().
  VoxelVolume wholeVolume(const std::function<bool(std::uint32_t epoch)>& wanted) {
    return submaps_.wholeVolume([&](const Submap& submap) { return wanted(submap.epoch); });
  }
  /// A kept map before the first step, to be gone on with from where it ended: `fill(volume, submaps)` puts
  /// its blocks into both. The next pose is not judged against the last.
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
  /// Where it was last [m].
  [[nodiscard]] const Eigen::Vector3d& vehicle() const { return vehicle_; }

  /// Null where the rig has one camera.
  [[nodiscard]] const DepthStage* stereo() const { return pair_ ? &pair_->depth : nullptr; }
  [[nodiscard]] const DistanceField& distance() const { return distance_; }
  [[nodiscard]] const VoxelVolume& volume() const { return volume_; }
  [[nodiscard]] const VolumeIntegrator& integrator() const { return integrator_; }
  [[nodiscard]] const SurfaceStore& surface() const { return store_; }
  /// All patches in memory, ordered by block, each where its submap lies by now.
  void visitSurface(SurfaceSink& sink);
  [[nodiscard]] const SurfaceSettings& surfaceSettings() const { return surface_settings_; }
  [[nodiscard]] const SurfaceStage& surfaceStage() const { return surface_; }
  [[nodiscard]] const MapCounters& counters() const { return counters_; }

 private:
  /// A depth sensor, and what camera 0 sees at its pixels.
  struct Sensor {
    Sensor(const DepthImageView& camera, const Rig& rig, const MapSettings& settings);
    SensorDepth depth;
    ViewWarp warp;
    DepthBuffer buffer;
  };
  /// Two cameras.
  struct Pair {
    Pair(const Rig& rig, const MapSettings& settings);
    DepthStage depth;
    DepthBuffer buffer;
    std::optional<UnrolledDepth> unrolled;  ///< where the shutter rolls
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
  Eigen::Vector3d vehicle_ = Eigen::Vector3d::Zero();  ///< last
  Stamp newest_;                                       ///< image in the volume
  MapCounters counters_;
};

}  // namespace swiftlet
