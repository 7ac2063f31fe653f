#pragma once
// Simulated flights of which something is not as the estimator is told: calibration, stamps, noise, or the
// scene. For what is asked of health.

#include <array>
#include <cstdint>
#include <vector>

#include "tests/smoother/track_flight.hpp"

namespace swiftlet::test {

enum class RigFault : std::uint8_t {
  kNone,
  kFocal,      ///< focal lengths given 5 to 15 % off
  kTurned,     ///< cameras given turned by 3 to 20 degrees
  kExchanged,  ///< axes of the IMU exchanged
  kLate,       ///< image stamps off by 20 to 150 ms, either way
  kJitter,     ///< image stamps off by a new amount each time, sigma 20 ms
  kRolling,    ///< rows read one after the other, 30 ms from first to last
  kLoud,       ///< noise densities given ten times too large
  kQuiet,      ///< given ten times too small
  kMoving,     ///< 30 to 50 % of what is seen swings to and fro together, by 0.2 to 0.8 m
  kBlur,       ///< coordinates are known to 3 to 6 px, half of the tracks are lost at each frame
};
inline constexpr std::array<const char*, 11> kRigFaultNames{
    "none", "focal", "turned", "exchanged", "late", "jitter", "rolling", "loud", "quiet", "moving", "blur"};

/// What the estimator is told of a flight, whatever it sees.
struct GivenFlight {
  Rig rig;
  ImuNoise noise;
  std::vector<ImuSample> samples;
  std::vector<Stamp> stamps;  ///< of the images
};

/// Faults of calibration, stamps and noise figures; others leave it as it is.
void spoil(RigFault fault, std::uint64_t seed, GivenFlight& given);

/// What the estimator gets of a flight.
struct FaultyFlight {
  FaultyFlight(const SimulationSettings& settings, RigFault fault, std::uint64_t seed);

  TrackFlight flight;  ///< with the truth
  GivenFlight given;
  std::vector<TrackedFrame> frames;
};

}  // namespace swiftlet::test
