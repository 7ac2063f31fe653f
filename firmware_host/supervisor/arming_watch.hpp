#pragma once
// Collects the facts for ReadyToArm, each time the supervisor steps: ages grow even if no frame and no sample
// arrives.
//
// Pure: facts and the time in, verdict out; no clock, no heap.

#include <cstdint>
#include <optional>
#include <span>

#include "firmware_host/realtime/ready_to_arm.hpp"
#include "firmware_host/supervisor/flight_facts.hpp"
#include "firmware_host/supervisor/verdict.hpp"

namespace swiftlet {

class ArmingWatch {
 public:
  void begin(const FlightGround& ground);

  /// `health`: the estimator's. `troubles`: the supervisor's current ones.
  ArmingVerdict evaluate(const FlightFacts& facts, Health health, std::span<const Trouble> troubles,
                         Stamp now);

 private:
  void measureRate(const SensorNews& imu, std::uint64_t reversed, ArmingFacts& facts);

  FlightGround ground_;
  ReadyToArm rule_;
  // Marks for rate and stamps: the look-back is between one and two times kLookBack.
  struct Mark {
    Stamp stamp;
    std::uint64_t samples = 0;
    std::uint64_t reversed = 0;
  };
  std::optional<Mark> older_;
  std::optional<Mark> newer_;
  std::optional<Stamp> good_since_;
  std::optional<Stamp> tilted_since_;
  std::optional<Stamp> epoch_since_;
  std::uint32_t epoch_ = 0;
  std::uint64_t frames_ = 0;
  Stamp frame_at_;  ///< host time at which the newest frame was first seen
};

}  // namespace swiftlet
