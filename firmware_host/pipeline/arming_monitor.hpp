#pragma once
// Watches whether the vehicle may be armed, frame by frame, on the thread `log`.

#include <optional>
#include <string>

#include "firmware_host/pipeline/arrows.hpp"
#include "firmware_host/realtime/ready_to_arm.hpp"

namespace swiftlet {

struct SensorFacts;

/// What stands before the first message and does not change.
struct ArmingGround {
  int flight_threads = 0;
  int threads_without_priority = 0;
  std::string first_without_priority;
  bool memory_locked = false;
  double imu_rate = 0;  ///< Hz, the calibration's
  double speed = 1;     ///< of the log's clock against the host's
  int cameras = 0;
  bool recorder_wanted = false;
};

class ArmingMonitor {
 public:
  /// Before the first message.
  void begin(const ArmingGround& ground) { ground_ = ground; }

  /// After each frame. True when the list of missing conditions has changed.
  bool update(const FrameResult& result, const SensorFacts& sensors, bool recorder_running,
              std::uint64_t recorder_lost, double now);

  [[nodiscard]] const ArmingVerdict& verdict() const { return verdict_; }
  /// Stamp of the first frame at which nothing was missing.
  [[nodiscard]] const std::optional<Stamp>& firstReady() const { return first_ready_; }

 private:
  void measureRate(const SensorFacts& sensors, ArmingFacts& facts);

  ArmingGround ground_;
  ReadyToArm rule_;
  ArmingVerdict verdict_;
  bool any_ = false;
  std::optional<Stamp> first_ready_;
  // The look-back of rate and stamps: between one and two times kLookBack.
  struct Mark {
    Stamp stamp;
    std::uint64_t samples = 0;
    std::uint64_t reversed = 0;
  };
  std::optional<Mark> older_;
  std::optional<Mark> newer_;
  std::optional<Stamp> good_since_;
  std::optional<Stamp> epoch_since_;
  std::uint32_t epoch_ = 0;
};

}  // namespace swiftlet
