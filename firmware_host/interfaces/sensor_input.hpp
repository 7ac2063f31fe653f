#pragma once
// Input of a threaded run: a log played at its recorded times (log_player.hpp), or devices
// (firmware_host/inputs/devices).
//
// An input has one thread per device. The executor starts the threads at their levels and ends the run when
// the last one has ended. Each thread hands its messages to the sink: all IMU messages from one thread, all
// messages of a camera from one thread (a thread may serve two cameras).

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/scene_images.hpp"
#include "firmware_host/interfaces/host_times.hpp"
#include "firmware_host/interfaces/run_control.hpp"
#include "firmware_host/supervisor/flight_facts.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

class SensorSink {
 public:
  SensorSink() = default;
  SensorSink(const SensorSink&) = delete;
  SensorSink& operator=(const SensorSink&) = delete;
  virtual ~SensorSink() = default;

  virtual void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) = 0;
  /// Called by the thread of camera 0, before its image.
  virtual void takeScene(const SceneImages& scene) = 0;
  virtual void takeImage(const CameraFrame& image, const HostTimes& host) = 0;
  /// Called by any thread: the input has ended and its threads return.
  virtual void expectEnd() {}
};

class SensorInput {
 public:
  /// Priority level of a thread.
  enum class Level : std::uint8_t {
    kSensor,   ///< a device's thread, at the priority of sensors
    kLibrary,  ///< a device whose library or decoder allocates and locks: below the flight path, like the map
    kAhead,    ///< reads ahead from a file, without real-time priority
  };
  struct Thread {
    const char* name = "";
    Level level = Level::kSensor;
    std::function<void()> run;
    /// Beats at each turn of a thread that runs until it is stopped; null: not supervised.
    Heartbeat* heart = nullptr;
  };

  SensorInput() = default;
  SensorInput(const SensorInput&) = delete;
  SensorInput& operator=(const SensorInput&) = delete;
  virtual ~SensorInput() = default;

  /// The threads of this input. Each ends when the input has ended, or soon after `control` requests a stop.
  /// `sink` and `control` outlive them.
  virtual std::vector<Thread> threads(SensorSink& sink, const RunControl& control) = 0;
  /// Any thread: number of images handed over so far.
  [[nodiscard]] virtual std::uint64_t taken() const = 0;
  /// Any thread: adds facts about the sensors that do not pass through the sink.
  virtual void look(FlightFacts& /*facts*/) const {}
  /// After the threads have ended; throws the error that ended the input early.
  virtual void finish() {}
};

}  // namespace swiftlet
