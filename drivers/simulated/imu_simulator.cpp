#include "drivers/simulated/imu_simulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

// Streams of the random generator, one for each source of error.
constexpr std::uint64_t kWhiteStream = 21;
constexpr std::uint64_t kWalkStream = 22;
constexpr std::uint64_t kBiasStream = 23;
constexpr std::uint64_t kVibrationStream = 24;

Eigen::Vector3d normal3(Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

class VibrationSignal {
 public:
  VibrationSignal(const Vibration& vibration, std::uint64_t seed) {
    Random random(seed, kVibrationStream);
    for (Tone& tone : tones_) {
      tone.omega = 2.0 * std::numbers::pi * random.uniform(vibration.low_hz, vibration.high_hz);
      for (double& phase : tone.phase) phase = random.uniform(0.0, 2.0 * std::numbers::pi);
    }
  }
  // Six channels (gyro, accel) of unit amplitude.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> at(double t) const {
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Tone& tone : tones_) {
      for (int channel = 0; channel < 6; ++channel) {
        sum[channel] += std::sin(tone.omega * t + tone.phase[static_cast<std::size_t>(channel)]);
      }
    }
    return sum / std::sqrt(static_cast<double>(kTones));
  }

 private:
  static constexpr std::size_t kTones = 8;
  struct Tone {
    double omega = 0;
    std::array<double, 6> phase{};
  };
  std::array<Tone, kTones> tones_{};
};

bool inAny(const std::vector<TimeSpan>& spans, double t) {
  return std::any_of(spans.begin(), spans.end(), [t](const TimeSpan& span) { return span.contains(t); });
}

Eigen::Vector3d clip(const Eigen::Vector3d& value, double limit) {
  return value.cwiseMax(-limit).cwiseMin(limit);
}

}  // namespace

SimulatedImu simulateImu(const SplineTrajectory& trajectory, const ImuSimulationSettings& settings,
                         Stamp zero, double duration) {
  const ImuNoise& noise = settings.noise;
  const double interval = 1.0 / noise.rate_hz;
  const double white_scale = settings.noise_free ? 0.0 : std::sqrt(noise.rate_hz);
  const double walk_scale = settings.noise_free ? 0.0 : std::sqrt(interval);
  const Eigen::Vector3d up(0, 0, noise.gravity);

  Random white(settings.seed, kWhiteStream);
  Random walk(settings.seed, kWalkStream);
  Random initial(settings.seed, kBiasStream);
  const VibrationSignal vibration(settings.vibration, settings.seed);
  const bool vibrates = !settings.noise_free &&
                        (settings.vibration.accel_amplitude > 0 || settings.vibration.gyro_amplitude > 0);
  const Eigen::Matrix3d ideal = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d gyro_matrix = settings.noise_free ? ideal : settings.gyro_matrix;
  const Eigen::Matrix3d accel_matrix = settings.noise_free ? ideal : settings.accel_matrix;
  Eigen::Vector3d bias_gyro = settings.bias_gyro;
  Eigen::Vector3d bias_accel = settings.bias_accel;
  if (settings.noise_free) {
    bias_gyro.setZero();
    bias_accel.setZero();
  } else if (settings.draw_bias) {
    bias_gyro = settings.gyro_bias_sigma * normal3(initial);
    bias_accel = settings.accel_bias_sigma * normal3(initial);
  }

  SimulatedImu imu;
  const auto count = static_cast<std::int64_t>(std::floor(duration * noise.rate_hz + 1e-6)) + 1;
  imu.samples.reserve(static_cast<std::size_t>(count));
  for (std::int64_t k = 0; k < count; ++k) {
    const double t = static_cast<double>(k) * interval;
    const MotionState motion = trajectory.at(t);
    ImuSample sample;
    sample.stamp = zero + Duration{std::llround(static_cast<double>(k) * 1e9 / noise.rate_hz)};
    sample.gyro =
        gyro_matrix * motion.omega_body + bias_gyro + noise.gyro_density * white_scale * normal3(white);
    const Eigen::Vector3d force = motion.T_world_body.rotation.conjugate() * (motion.a_world_body + up);
    sample.accel = accel_matrix * force + bias_accel + noise.accel_density * white_scale * normal3(white);
    if (vibrates) {
      const Eigen::Matrix<double, 6, 1> shake = vibration.at(t);
      sample.gyro += settings.vibration.gyro_amplitude * shake.head<3>();
      sample.accel += settings.vibration.accel_amplitude * shake.tail<3>();
    }
    const bool clips = inAny(settings.saturations, t);
    const double gyro_limit = clips ? settings.low_gyro_limit : noise.gyro_saturation;
    const double accel_limit = clips ? settings.low_accel_limit : noise.accel_saturation;
    sample.gyro = clip(sample.gyro, gyro_limit);
    sample.accel = clip(sample.accel, accel_limit);
    if (!inAny(settings.gaps, t)) imu.samples.push_back(sample);
    imu.bias_gyro.push_back(bias_gyro);
    imu.bias_accel.push_back(bias_accel);
    bias_gyro += noise.gyro_walk * walk_scale * normal3(walk);
    bias_accel += noise.accel_walk * walk_scale * normal3(walk);
  }
  return imu;
}

}  // namespace swiftlet
