#pragma once
// Compares gyro and camera: finds the time shift, axes and unit that map one's rotations to the other's.
//
// Model: turn_k = Q s (G(t_k + shift) - G(t_k-1 + shift)) + b (t_k - t_k-1), with an orthogonal Q, a scale s
// and an offset b; G is the gyro's integral. The shift is found by a scan over +-kMaxShift with a free 3 x 3
// matrix instead of Q s, so that no mistake in axes or unit hides it. Weights are robust (Cauchy). Q: Kabsch,
// once with determinant 1 and once with -1, which only left-handed axes need.

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "firmware_host/inspection/camera_turns.hpp"

namespace swiftlet {

inline constexpr double kMaxShift = 10;  // s

struct MotionFit {
  std::size_t turns = 0;
  double shift = 0;        ///< s, t_imu = t_image + shift
  double shift_sigma = 0;  ///< s
  double explained = 0;    ///< share of the camera's turns that the gyro explains (R^2) at `shift`
  double noise = 0;        ///< rad per axis and turn, of the residuals
  double turned_deg = 0;   ///< root mean square of the camera's turns, per turn
  double scale = 1;        ///< camera over gyro: 1, or pi / 180 for a gyro in degrees
  Eigen::Matrix3d R_cam_imu = Eigen::Matrix3d::Identity();  ///< best rotation with determinant 1
  Eigen::Matrix3d mirrored = -Eigen::Matrix3d::Identity();  ///< best with determinant -1
  double mirror_gain = 0;  ///< log likelihood of `mirrored` minus that of R_cam_imu
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of R_cam_imu, camera axes [1/rad^2]
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();       ///< b [rad/s], camera axes
  std::vector<double> weights;                            ///< one per turn; 0: not covered by samples
  double weight = 0;                                      ///< sum of the weights

  /// Log likelihood gained by reducing the variance of the turns by the factor `times`.
  [[nodiscard]] double gainOf(double times) const { return 1.5 * weight * std::log(times); }
};

class MotionFitter {
 public:
  MotionFitter(const std::vector<CameraTurn>& turns, const GyroIntegral& gyro);

  /// Empty if the overlap is too short.
  [[nodiscard]] std::optional<MotionFit> fit(double calibrated_shift);
  /// Log likelihood of the fit minus that of another shift, of other axes or of another scale, in units of
  /// independent turns: 1/2 chi^2 for small differences.
  [[nodiscard]] double gainOverShift(const MotionFit& fit, double shift) const;
  [[nodiscard]] double gainOverAxes(const MotionFit& fit, const Eigen::Matrix3d& R_cam_imu) const;
  /// Share of the images' deviation from an even clock (`times`, one per image) that is an error of their
  /// stamps, according to the camera's rotations; and its sigma.
  struct Evenness {
    double share = 0;
    double sigma = 1;
  };
  [[nodiscard]] Evenness evenness(const MotionFit& fit, const std::vector<double>& times) const;

 private:
  struct Sums;
  [[nodiscard]] Sums sumsAt(double shift, const std::vector<double>& weights) const;
  [[nodiscard]] Eigen::Vector3d gyroTurn(const CameraTurn& turn, double shift) const;
  [[nodiscard]] std::vector<double> robustWeights(double shift, const Sums& sums) const;
  [[nodiscard]] double scan(const std::vector<double>& weights, double begin, double end, double step) const;
  /// A Gauss-Newton step of the shift [s]. `information`: of the shift, in units of the noise.
  [[nodiscard]] double shiftStep(double shift, const std::vector<double>& weights, const Sums& sums,
                                 double& information) const;
  void solveAxes(const Sums& sums, MotionFit& fit) const;

  const std::vector<CameraTurn>& turns_;
  const GyroIntegral& gyro_;
};

}  // namespace swiftlet
