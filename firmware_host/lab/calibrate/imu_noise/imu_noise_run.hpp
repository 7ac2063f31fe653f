#pragma once
// Measures the noise of an IMU from a log at rest: called by `swiftlet calibrate imu-noise`.
//
// The log is read twice: to find motion, then for the Allan variance of the parts at rest. Samples are
// counted and not placed by their stamps, so that jitter of the stamps has no effect; a gap of more than ten
// periods interrupts. Cost: 2 us per sample of a text file. Memory: see still_spans.hpp.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"
#include "firmware_host/lab/calibrate/imu_noise/noise_fit.hpp"

namespace swiftlet {

struct ImuNoiseResult {
  std::string log;
  double rate_hz = 0;
  double seconds = 0;         ///< of the log
  double used_seconds = 0;    ///< at rest
  std::uint64_t samples = 0;  ///< used
  std::uint64_t holes = 0;    ///< of more than ten periods
  std::vector<AllanPoint> points;
  std::array<AxisNoise, 6> axis;     ///< gyro x y z, accelerometer x y z
  std::vector<std::string> motions;  ///< where the log moves
  std::vector<std::string> remarks;  ///< what limits the result, one sentence each with its remedy
  std::vector<std::string> warnings;
};

/// InputError if the log cannot be read, or has no ten seconds at rest.
ImuNoiseResult measureImuNoise(const std::string& log);

/// Kalibr's imu.yaml: for each quantity the largest axis. An unknown random walk is written as a comment.
std::string imuNoiseYaml(const ImuNoiseResult& result);
/// The result as text for the terminal.
std::string imuNoiseText(const ImuNoiseResult& result);

}  // namespace swiftlet
