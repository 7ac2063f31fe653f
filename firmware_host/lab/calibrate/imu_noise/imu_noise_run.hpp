#pragma once
// The noise of an IMU from a log at rest: what `swiftlet calibrate imu-noise` calls.
//
// The log is read twice: for motion, then for the Allan variance of what stands still. Samples are counted,
// not placed by their stamps, so that jitter of the stamps has no effect; a hole of more than ten periods
// interrupts. Cost: 2 us a sample of a text file. Memory: still_spans.hpp.

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
  std::vector<std::string> remarks;  ///< what limits the result, a sentence each with its remedy
  std::vector<std::string> warnings;
};

/// InputError if the log cannot be read, or has no rest of ten seconds.
ImuNoiseResult measureImuNoise(const std::string& log);

/// Kalibr's imu.yaml: of each kind the largest axis. A random walk that is not known is a comment.
std::string imuNoiseYaml(const ImuNoiseResult& result);
/// What was found in words, for the terminal.
std::string imuNoiseText(const ImuNoiseResult& result);

}  // namespace swiftlet
