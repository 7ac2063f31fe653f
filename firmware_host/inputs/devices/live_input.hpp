#pragma once
// The vehicle's devices as the input of a threaded run: one thread each for the IMU, every video node,
// pipeline or topic, and the trigger line, as set in the settings.
//
// All devices must be present when the flight starts. In flight each may be unplugged and return, fall silent
// or send garbage while the others continue. Faults are logged with the device's name and the remedy.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "firmware_host/inputs/devices/camera_thread.hpp"
#include "firmware_host/inputs/devices/imu_thread.hpp"
#include "firmware_host/inputs/devices/trigger_thread.hpp"
#include "firmware_host/interfaces/link_outbox.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Number of cameras named in the settings, one or two.
std::size_t namedCameras(const Settings& settings);

class LiveInput : public SensorInput {
 public:
  /// IMU, cameras, trigger.
  static constexpr std::size_t kMostThreads = 2 + kMaxCameras;

  /// InputError naming the setting if the settings name too few devices, or too many for the rig.
  LiveInput(const Settings& settings, const Calibration& calibration);
  ~LiveInput() override;

  /// Opens all devices. Reports one line for each that did not open or applied a setting differently.
  struct Opened {
    std::vector<std::string> faults;
    std::vector<std::string> warnings;
  };
  Opened open();

  std::vector<Thread> threads(SensorSink& sink, const RunControl& control) override;
  /// Adds the trigger's edges.
  void look(FlightFacts& facts) const override;
  [[nodiscard]] std::uint64_t taken() const override;
  /// How long a frame waits for its samples.
  [[nodiscard]] Duration samplePatience() const;

  /// For one thread: passes what has happened to devices since the last call, as lines for the user. True:
  /// there was something.
  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take);
  /// After the flight: the devices' statistics.
  [[nodiscard]] nlohmann::ordered_json counters();

  /// Outbox of the IMU's link if autopilot.device is that link; null otherwise.
  [[nodiscard]] LinkOutbox* outbox() { return outbox_.get(); }
  [[nodiscard]] ImuThread& imu() { return *imu_; }
  [[nodiscard]] std::span<const std::unique_ptr<CameraThread>> cameras() const { return cameras_; }
  /// Whether cameras are triggered, by edges of a GPIO line or of the IMU.
  [[nodiscard]] bool hasTrigger() const { return trigger_ != nullptr || !imu_edges_.cameras.empty(); }
  /// Null: no GPIO line is connected.
  [[nodiscard]] TriggerThread* trigger() { return trigger_.get(); }

 private:
  [[nodiscard]] std::vector<DeviceJournal*> journals();

  std::unique_ptr<LinkOutbox> outbox_;
  SharedExposure asked_;
  std::unique_ptr<ImuThread> imu_;
  std::vector<std::unique_ptr<CameraThread>> cameras_;
  std::unique_ptr<TriggerThread> trigger_;
  std::vector<EdgeRing*> edge_rings_;  ///< one per camera thread
  ImuEdges imu_edges_;                 ///< without cameras unless the IMU gives the trigger
  bool topics_ = false;                ///< any device is a topic
};

}  // namespace swiftlet
