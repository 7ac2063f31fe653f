#pragma once
// A rig that a person moves in front of a calibration board, with exact truth.
//
// Motion: as calibration guides recommend. The board reaches every part of the image, at distances that
// differ by a factor of two, tilted by up to 45 degrees; in addition the rig swings about its three axes and
// along them (0.5 to 1.1 Hz), and the hand trembles a little (1.5 to 4 Hz). The board is often partly outside
// the image. The whole motion is one SplineTrajectory, which gives the truth and its derivatives.
// Corners: exact pixels, each at the time of its own row, plus white noise. Of an AprilGrid only complete
// tags are seen, as by a detector.
// Frames: world z up; the board stands about upright in it; body = IMU. Time: seconds since the trajectory's
// zero. Image stamps are the IMU clock's minus the rig's shift.
// Faulty data can be requested by the settings from `turning` on.
// Cost: 20 ms for a session of 60 s; 0.2 ms for the views of an image pair, 1.2 ms with a rolling shutter.
// The same settings give the same bytes.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/calibration_rig.hpp"
#include "drivers/simulated/imu_simulator.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

enum class Turning : std::uint8_t {
  kAll,
  kNoRoll,  ///< no rotation about the optical axis of camera 0
  kNone,    ///< no rotation at all
};

struct SessionSettings {
  std::uint64_t seed = 1;
  double duration = 60;                          ///< s
  double camera_rate = 20;                       ///< Hz
  std::vector<TimeSpan> rests;                   ///< in order; the motion fades out in the second before each
  std::array<double, 2> corner_sigma{0.1, 0.1};  ///< px per axis, for each camera
  double border = 4;                             ///< px: corners nearer to the image's edge are not seen
  Stamp start{1'700'000'000'000'000'000};        ///< of the trajectory's time zero

  Turning turning = Turning::kAll;
  /// Applied to the readings of both sensors: exchanged axes; with a determinant of -1 left-handed.
  Eigen::Matrix3d imu_axes = Eigen::Matrix3d::Identity();
  /// Errors of the image clock besides the rig's offset: constant, growing with time, and random.
  Duration clock_offset;
  double clock_drift = 0;   ///< s/s
  double stamp_jitter = 0;  ///< s, sigma; both cameras of a pair have the same stamp
};

class CalibrationSession {
 public:
  CalibrationSession(const CalibrationRig& rig, const CalibrationTarget& target,
                     const SessionSettings& settings);

  [[nodiscard]] const CalibrationRig& truth() const { return rig_; }
  [[nodiscard]] const CalibrationTarget& target() const { return target_; }
  [[nodiscard]] const SessionSettings& settings() const { return settings_; }
  [[nodiscard]] const SplineTrajectory& trajectory() const { return trajectory_; }  ///< T_world_body
  [[nodiscard]] const SE3& T_world_board() const { return T_world_board_; }
  [[nodiscard]] const SimulatedImu& imu() const { return imu_; }  ///< with the true biases

  [[nodiscard]] int imageCount() const { return image_count_; }
  [[nodiscard]] double imageTime(int k) const;  ///< time at which the middle row is exposed
  [[nodiscard]] Stamp imageStamp(int k) const;

  /// The corners that both cameras see in image k. A camera that sees none has a view without corners.
  [[nodiscard]] std::vector<BoardView> views(int k) const;
  /// The same without noise.
  [[nodiscard]] std::vector<BoardView> exactViews(int k) const;

 private:
  void move();
  [[nodiscard]] BoardView exactView(int k, std::size_t camera) const;
  [[nodiscard]] bool see(double seconds, std::size_t camera, const Eigen::Vector3d& p_world,
                         Eigen::Vector2d& pixel) const;

  CalibrationRig rig_;
  CalibrationTarget target_;
  SessionSettings settings_;
  SE3 T_world_board_;
  SplineTrajectory trajectory_;
  SimulatedImu imu_;
  int image_count_ = 0;
};

}  // namespace swiftlet
