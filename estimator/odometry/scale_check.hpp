#pragma once
// Checks the scale of a one-camera estimate against the accelerometer, independently of the smoother's own
// covariance.
//
// A Kalman filter over neighbouring keyframes. The smoother gives their displacement up to an unknown factor
// s (true length over estimated length); the IMU gives it in metres. States: velocity, s, tilt of the world,
// accelerometer bias. The model is linear in all of them:
//   s (p_j - p_i) = v_i t + g t^2 / 2 + R_i alpha(ba),   v_j = v_i + g t + R_i beta(ba).
// s becomes observable when the body accelerates. Process noise on s forgets old evidence, so that later
// drift or collapse of the scale is detected too. While a start settles, the smoother corrects the scale of
// its whole window; until the scale is confirmed, such a correction discards the evidence. Rotations and gyro
// bias are taken from the smoother, because images determine them. Frames: world, body. Memory: 2 kB. Cost:
// 12 triangular solves of the window's system per keyframe. Source: Martinelli, "Closed-form solution of
// visual-inertial structure from motion", IJCV 2014 (alignment).

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "estimator/imu/imu_noise.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

class ScaleCheck {
 public:
  /// The scale counts as known if its relative sigma is below this.
  static constexpr double kKnown = 0.08;
  /// The scale agrees if |s - 1| is below this plus this many sigmas.
  static constexpr double kAgrees = 0.10;
  static constexpr double kAgreesSigmas = 2;
  /// The estimate must be restarted if |s - 1| is above this plus this many sigmas. Discarding a correct
  /// estimate is worse than doubting it, so these limits are wider.
  static constexpr double kContradicts = 0.15;
  static constexpr double kContradictsSigmas = 3;

  explicit ScaleCheck(const ImuNoise& noise) : noise_(noise) { reset(); }

  /// Starts a new epoch without evidence.
  void reset();
  /// Call after a step's trim: uses the newest keyframe that stays, once.
  void update(Smoother& smoother);

  /// True over estimated length.
  [[nodiscard]] double scale() const { return x_[kScale]; }
  [[nodiscard]] double sigma() const;
  /// Whether the scale was known and agreed once since reset(). Stays true without further acceleration.
  [[nodiscard]] bool confirmed() const { return confirmed_; }

 private:
  enum : int { kVelocity = 0, kScale = 3, kTilt = 4, kBias = 6, kSize = 9, kMoved = 9, kAll = 12 };
  using Vector = Eigen::Matrix<double, kAll, 1>;
  using Matrix = Eigen::Matrix<double, kAll, kAll>;

  void forget();
  /// Sets the velocity to the estimate's times the scale, with a large sigma.
  void forgetVelocity(const WindowState& state);
  void watchCorrections(const Window& window, std::size_t settled);
  void propagate(const WindowState& i, const Preintegration& imu);
  void measure(const Eigen::Vector3d& displacement, double variance);

  ImuNoise noise_;
  Vector x_ = Vector::Zero();
  Matrix P_ = Matrix::Zero();
  bool any_ = false;
  bool confirmed_ = false;
  double corrected_ = 1;  // the smoother's change of its scale since the evidence began, as a factor
  struct Baseline {
    std::uint64_t first;
    std::uint64_t last;
    double distance;
  };
  std::optional<Baseline> old_;  // between two keyframes of the window at the last call
  std::uint64_t newest_ = 0;     // frame of the last keyframe used
};

}  // namespace swiftlet
