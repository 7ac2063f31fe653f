#pragma once
// A flight generated from its settings: trajectory, world, rig, IMU readings, and images on demand.

#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/simulated/simulation_settings.hpp"

namespace swiftlet {

class SimulatedFlight {
 public:
  /// Builds the trajectory, the world and the IMU readings (milliseconds; no textures yet). Throws
  /// std::invalid_argument naming the setting, or InputError naming the file.
  explicit SimulatedFlight(const SimulationSettings& settings);

  /// The settings as used: with seeds for all parts, low light and faults applied, and the world fitted to a
  /// given motion.
  [[nodiscard]] const SimulationSettings& settings() const { return settings_; }
  [[nodiscard]] const SplineTrajectory& trajectory() const { return trajectory_; }
  [[nodiscard]] const World& world() const { return world_; }
  [[nodiscard]] const Rig& trueRig() const { return true_rig_; }
  /// The calibration given to the estimator: extrinsics rotated, time offset zero, as configured.
  [[nodiscard]] const Rig& givenRig() const { return given_rig_; }
  [[nodiscard]] const SimulatedImu& imu() const { return imu_; }
  [[nodiscard]] double duration() const { return duration_; }  ///< s of IMU data

  [[nodiscard]] int imageCount() const { return image_count_; }
  /// Mid-exposure time of image k on the trajectory [s].
  [[nodiscard]] double imageTime(int k) const;
  /// Stamp of image k in the log.
  [[nodiscard]] Stamp imageStamp(int k) const;
  [[nodiscard]] Stamp stampAt(double seconds) const {
    return settings_.start + Duration::fromSeconds(seconds);
  }
  [[nodiscard]] bool hasFault(FaultKind kind, std::size_t camera, double seconds) const;

 private:
  void checkSettings() const;
  void flyAndBuild();

  SimulationSettings settings_;
  SplineTrajectory trajectory_;
  World world_;
  Rig true_rig_;
  Rig given_rig_;
  SimulatedImu imu_;
  double duration_ = 0;
  int image_count_ = 0;
};

/// Renders the images of a flight in order: exposure and gain depend on earlier images.
class FlightCameras {
 public:
  /// Paints the world (seconds). The flight must outlive this.
  explicit FlightCameras(const SimulatedFlight& flight);

  [[nodiscard]] const TexturedWorld& world() const { return *world_; }
  /// Exposure and gain of the newest images.
  [[nodiscard]] const ExposureSetting& takenWith() const { return taken_with_; }
  [[nodiscard]] std::size_t cameraCount() const { return renderers_.size(); }

  /// Renders image k of every camera, k increasing; `grey[c]` holds width x height bytes. If a camera is
  /// missing at that time, its entry is unchanged and its `present` is false.
  void render(int k, const std::array<std::uint8_t*, kMaxCameras>& grey,
              std::array<bool, kMaxCameras>& present);

 private:
  const SimulatedFlight* flight_;
  std::unique_ptr<TexturedWorld> world_;
  std::vector<CameraRenderer> renderers_;
  SimulatedExposure exposure_;
  ExposureSetting taken_with_;  ///< of the newest frame's images
  std::vector<float> radiance_;
};

}  // namespace swiftlet
