#pragma once
// What feeds a threaded run: a log let out at its times (log_player.hpp), or devices
// (firmware_host/inputs/devices).
//
// An input brings its own threads, one for each device; the executor starts them, at the level that each has,
// and ends the run when the last has ended. Each hands its messages to the sink from its own thread: those of
// the IMU from one, those of a camera from one (a thread may have two cameras).

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
  /// Of the thread of camera 0, before its image.
  virtual void takeScene(const SceneImages& scene) = 0;
  virtual void takeImage(const CameraFrame& image, const HostTimes& host) = 0;
  /// Any thread: the input has come to its end, and its threads return.
  virtual void expectEnd() {}
};

class SensorInput {
 public:
  /// Where a thread stands.
  enum class Level : std::uint8_t {
    kSensor,   ///< a device's, at the priority of sensors
    kLibrary,  ///< a device's whose library or codec allocates and locks: below the flight path, as maps
    kAhead,    ///< reads ahead from a file, at no priority
  };
  struct Thread {
    const char* name = "";
    Level level = Level::kSensor;
    std::function<void()> run;
    /// Beats at each turn of one that returns only when it is told to; null: nobody watches it.
    Heartbeat* heart = nullptr;
  };

  SensorInput() = default;
  SensorInput(const SensorInput&) = delete;
  SensorInput& operator=(const SensorInput&) = delete;
  virtual ~SensorInput() = default;

  /// The threads, of which each ends when its input has, or soon after `control` says stop. Both outlive
  /// them.
  virtual std::vector<Thread> threads(SensorSink& sink, const RunControl& control) = 0;
  /// Any thread: images gone by so far.
  [[nodiscard]] virtual std::uint64_t taken() const = 0;
  /// Any thread: what it knows of its sensors that does not pass the sink.
  virtual void look(FlightFacts& /*facts*/) const {}
  /// After the threads have ended; throws what ended the input before its time.
  virtual void finish() {}
};

}  // namespace swiftlet
