#pragma once
// The batch over all corners and IMU readings of a log: state, residuals, Jacobians and their solution.
//
// Frames: board (x right, y up, z out of it) is the world; body = IMU with the accelerometer's axes.
// Model, t on the IMU's clock in seconds since the origin:
//   T_board_body(t): SplineTrajectory (quintic on R^3, cumulative quintic on SO(3));
//   biases: piecewise linear, tied by random walks;
//   corner: pixel = lens(T_body_cam^-1 T_board_body(t)^-1 (scale corner)) + noise,
//           t = stamp + shift + drift (stamp - middle of the log) + readout row;
//   gyro = gyro_matrix omega + bias + noise; accel = accel_matrix R_body_board (a - gravity) + bias + noise.
// Solution: Gauss-Newton with Levenberg's damping on the arrow matrix of arrow_system.hpp; Jacobians are
// analytic. Cost: some 0.5 s an iteration for 60 s of stereo at 20 Hz with 144 corners each. Two threads.
// Sources: Furgale, Rehder, Siegwart, "Unified temporal and spatial calibration for multi-sensor systems",
// IROS 2013; Rehder et al., "Extending kalibr", ICRA 2016; Sommer et al., CVPR 2020.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "firmware_host/lab/calibrate/cameras/lens_jacobian.hpp"
#include "firmware_host/lab/calibrate/imu_camera/arrow_system.hpp"

namespace swiftlet {

/// Columns of the calibration.
namespace batch {
inline constexpr int kPerCamera = kLensParameters + 6;
constexpr int lens(std::size_t camera) { return kPerCamera * static_cast<int>(camera); }
constexpr int rotation(std::size_t camera) { return lens(camera) + kLensParameters; }  // R <- R Exp
constexpr int position(std::size_t camera) { return rotation(camera) + 3; }
inline constexpr int kShift = kPerCamera * static_cast<int>(kMaxCameras);
inline constexpr int kReadout = kShift + 1;
inline constexpr int kGravity = kReadout + 1;  ///< two rotations of its direction [rad]
inline constexpr int kGyro = kGravity + 2;     ///< 3 x 3, row by row
inline constexpr int kAccel = kGyro + 9;       ///< xx yx yy zx zy zz
inline constexpr int kScale = kAccel + 6;      ///< of the board: only for testing its size
inline constexpr int kDrift = kScale + 1;      ///< of the images' clock: only for testing
inline constexpr int kColumns = kDrift + 1;
}  // namespace batch

struct SeenCorner {
  int id = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the board [m]
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  bool outlier = false;
};

struct SeenView {
  double time = 0;  ///< s, on the images' clock since the origin
  std::size_t camera = 0;
  std::vector<SeenCorner> corners;
};

struct TimedReading {
  double time = 0;  ///< s since the origin
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
};

struct BatchData {
  std::vector<SeenView> views;         ///< in order of time
  std::vector<TimedReading> readings;  ///< in order of time
  ImuNoise noise;
};

struct BatchState {
  SplineTrajectory spline;                        ///< T_board_body
  std::vector<Eigen::Matrix<double, 6, 1>> bias;  ///< gyro, accelerometer; the first at spline.startTime()
  int bias_every = 1;                             ///< distance in knots
  std::size_t camera_count = 0;
  std::array<CameraModel, kMaxCameras> camera;
  std::array<SE3, kMaxCameras> T_body_cam;
  double shift = 0;                                   ///< s, t_imu = t_image + shift
  double readout = 0;                                 ///< s
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s^2 in board axes; its length is known
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  double scale = 1;
  double drift = 0;  ///< s/s

  [[nodiscard]] double row(std::size_t c, double v) const { return v / (camera[c].height() - 1) - 0.5; }
  [[nodiscard]] Eigen::Matrix<double, 6, 1> biasAt(double time) const;
};

/// Standard deviations that weight the residuals, updated from the residuals.
struct BatchNoise {
  double corner = 0.2;  ///< px per axis
  double gyro = 1;      ///< times the density's
  double accel = 1;     ///< times the density's
};

enum class Residuals : std::uint8_t { kCorner, kGyro, kAccel };
inline constexpr int kResidualKinds = 3;

class BatchProblem {
 public:
  /// `data` and `target` must outlive this object. Priors keep values that the log does not determine near
  /// their start; see the source.
  BatchProblem(const BatchData& data, BatchState state, const BatchNoise& noise);

  [[nodiscard]] const BatchState& state() const { return state_; }
  [[nodiscard]] const BatchNoise& noise() const { return noise_; }
  void setNoise(const BatchNoise& noise) { noise_ = noise; }
  /// Fixes `count` columns from `first` on.
  void hold(int first, int count, bool held = true);
  [[nodiscard]] bool held(int column) const { return held_[static_cast<std::size_t>(column)]; }
  void setReadout(double readout) { state_.readout = readout; }

  /// Iterates until a further step would gain less than `settled` squared sigmas. `robust`: Huber weights on
  /// corners. False: did not converge.
  bool solve(int iterations, bool robust, double settled);
  /// Halves the distance of the knots without changing the motion.
  void refineSpline();

  /// Sum of squares over the noise.
  [[nodiscard]] double cost(Residuals which) const;
  [[nodiscard]] std::size_t count(Residuals which) const;  ///< number of residuals
  /// Number of residuals of each kind minus the unknowns it determines, by a random estimate of the trace
  /// (Hutchinson 1990).
  [[nodiscard]] std::array<double, kResidualKinds> redundancies() const;
  /// Covariance of the calibration's columns, followed by the mean gyro and accelerometer biases. Fixed
  /// columns have variance 1.
  [[nodiscard]] Eigen::MatrixXd covariance() const;
  /// The next step of the calibration [same units], with the columns that are free now.
  [[nodiscard]] Eigen::VectorXd nextStep() const;
  [[nodiscard]] int chainSize() const { return chain_; }
  [[nodiscard]] Eigen::Matrix<double, 6, 1> meanBias() const;

  [[nodiscard]] double seconds(const SeenView& view, const SeenCorner& corner) const;
  /// False: the corner has no pixel.
  bool residual(const SeenView& view, const SeenCorner& corner, Eigen::Vector2d& pixels) const;
  /// Reading - model.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> residual(const TimedReading& reading) const;
  [[nodiscard]] bool covers(double time) const {
    return time >= state_.spline.startTime() && time < state_.spline.endTime();
  }

  /// Fills `system`, which is emptySystem(), and returns the sum of weighted squares. With `probes`, random
  /// signs replace the residuals, one kind after the other.
  double assemble(ArrowSystem& system, bool robust, bool probes = false) const;
  [[nodiscard]] ArrowSystem emptySystem(int rights = 1) const {
    return {chain_, width_, batch::kColumns, rights};
  }
  /// The state after a step of all unknowns.
  [[nodiscard]] BatchState moved(const Eigen::VectorXd& step) const;

 private:
  struct Sum;
  void layOut();
  [[nodiscard]] int controlColumn(std::size_t control) const;
  [[nodiscard]] int biasColumn(std::size_t bias) const;
  void addView(const SeenView& view, Sum& sum) const;
  void addReadings(std::size_t first, std::size_t last, Sum& sum) const;
  double addPriors(ArrowSystem& system) const;
  [[nodiscard]] std::size_t segmentOf(double time) const;

  const BatchData& data_;
  BatchState state_;
  BatchNoise noise_;
  double middle_ = 0;  ///< s: reference time of the clock's drift
  std::array<bool, batch::kColumns> held_{};
  std::array<Eigen::Matrix<double, 8, 1>, kMaxCameras> lens_start_;
  int chain_ = 0;
  int width_ = 0;
};

}  // namespace swiftlet
