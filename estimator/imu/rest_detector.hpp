#pragma once
// Detects rest: whether the body stands still, since when, and the mean IMU readings meanwhile.
//
// Evaluates the readings of the last second in two bands. The slow band (scatter of 0.1 s means)
// distinguishes standing from flying even with idling rotors: their vibration averages out, while a hovering
// body is corrected a few times a second. The whole band (scatter of the samples) has loose limits, and a
// sample that jumps out of it ends a rest at once. The slow limits follow the sensor's own noise (the
// quietest window so far) between fixed bounds, so that they suit coarse and fine sensors.
//   IMU alone:  1 s within the limits, or 0.5 s well within them, if there are no images.
//   Images:     still: a rest begins within wider IMU limits. In place: it begins within the normal limits.
//               Slow: as In place, if the estimated speed is near zero too. Still, in place or slow: a rest
//               in progress continues within the wider limits. Moving: a rest ends. Otherwise no rest begins,
//               and one in progress continues within the normal limits.
// No rest begins while the estimated speed is significantly above zero, or while the mean rate exceeds any
// plausible gyro bias.
// Frames: body axes. Units: SI, pixels.
// Use `at_rest` only for a soft factor (zero velocity, unchanged pose), never to set a state.
// Cost: about 30 ns per sample. Memory: fixed, 3 kB; no allocation.
// Source: stance detection by windowed deviations: Skog, Handel, Nilsson, Rantakokko, "Zero-Velocity
// Detection", IEEE T-BME 2010; the two bands and the adaptive limits are this project's own.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// m/s, standard deviation of the velocity of a body at rest.
inline constexpr double kRestVelocitySigma = 0.01;

/// Image motion, as ImageStillness (estimator/odometry) classifies it.
enum class ImageMotion : std::uint8_t { kUnknown, kStill, kInPlace, kSlow, kUncertain, kMoving };

struct RestState {
  bool at_rest = false;
  /// Number of the rest, from 1; 0: not at rest. States with the same number have the same pose.
  std::uint32_t number = 0;
  Stamp since;                                           ///< start of the rest (valid at rest)
  double duration = 0;                                   ///< s, time covered by the means
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero();   ///< rad/s, over the rest: the gyro bias
  Eigen::Vector3d mean_accel = Eigen::Vector3d::Zero();  ///< m/s^2 over the rest
};

class RestDetector {
 public:
  explicit RestDetector(const ImuNoise& noise);

  /// Takes one accepted sample (stamps ascend). After a silence of more than 50 ms the windows start anew.
  void addImu(const ImuSample& sample);

  void addFrame(Stamp stamp, ImageMotion motion);

  /// Takes the estimate of a converged smoother. Without it mean rates up to 0.15 rad/s are accepted as bias.
  /// `bias_gyro_sigma`: rad/s. `speed`, `speed_sigma`: m/s; infinite sigma if the speed is unknown.
  void setEstimate(const Eigen::Vector3d& bias_gyro, double bias_gyro_sigma, double speed,
                   double speed_sigma);

  /// After a reset of the smoother: discards the bias and speed of setEstimate.
  void forgetEstimate() { has_estimate_ = false; }

  [[nodiscard]] const RestState& state() const { return state_; }
  void reset();

 private:
  struct Block {  // sums over 50 ms
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
    Eigen::Vector3d accel = Eigen::Vector3d::Zero();
    Eigen::Vector3d gyro_squares = Eigen::Vector3d::Zero();
    Eigen::Vector3d accel_squares = Eigen::Vector3d::Zero();
    double count = 0;
    Stamp begin;

    void add(const Block& other);
  };
  struct Window {
    Block sum;
    double gyro = 0, accel = 0;            // RMS deviation of the samples
    double slow_gyro = 0, slow_accel = 0;  // RMS deviation of the 0.1 s means
  };

  static constexpr std::size_t kLongBlocks = 20;   // 1 s
  static constexpr std::size_t kShortBlocks = 10;  // 0.5 s
  static constexpr std::size_t kImageBlocks = 6;   // 0.3 s

  [[nodiscard]] Window window(std::size_t blocks) const;
  [[nodiscard]] ImageMotion images() const;
  /// Whether the images move slowly.
  [[nodiscard]] bool shaken() const;
  [[nodiscard]] bool imagesHold() const;
  [[nodiscard]] bool meansAllow(const Window& w) const;
  [[nodiscard]] bool speedAllows() const;
  [[nodiscard]] bool standsByEstimate() const;
  [[nodiscard]] bool within(const Window& w, double slow_factor, double gyro_limit, double accel_limit) const;
  [[nodiscard]] bool withinImageLimits(const Window& w) const;
  [[nodiscard]] bool jumps(const ImuSample& sample) const;
  [[nodiscard]] bool drifts(const Block& block) const;
  [[nodiscard]] double imuSlack() const;
  void closeBlock();
  void startAnew();
  void begin(const Window& w);
  void end();
  void updateLimits(const Window& w);

  ImuNoise noise_;
  RestState state_;
  std::uint32_t rests_ = 0;
  std::array<Block, kLongBlocks> blocks_{};
  std::size_t block_count_ = 0;  // blocks closed since the windows began
  Block open_;
  bool has_last_ = false;
  Stamp last_;
  Block rest_;                                           // sums over the rest
  Eigen::Vector3d jump_gyro_ = Eigen::Vector3d::Zero();  // largest difference from the mean, per axis
  Eigen::Vector3d jump_accel_ = Eigen::Vector3d::Zero();
  double drift_gyro_ = 0;
  double drift_accel_ = 0;
  Eigen::Vector3d window_gyro_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d window_accel_ = Eigen::Vector3d::Zero();
  double slow_gyro_limit_;
  double slow_accel_limit_;
  ImageMotion image_motion_ = ImageMotion::kUnknown;
  Stamp image_stamp_;
  bool has_estimate_ = false;
  Eigen::Vector3d bias_gyro_ = Eigen::Vector3d::Zero();
  double bias_gyro_sigma_ = 0;
  double speed_ = 0;
  double speed_sigma_ = 0;
};

}  // namespace swiftlet
