#pragma once
// Scale and misalignment of the gyro in the window: zero, or estimated with its own columns.
//
// Nine columns, the matrix by columns, after those of the cameras' calibration. The reference of the prior is
// the value at the last marginalization. Entries that no rotation excites keep it, and the covariance
// includes their uncertainty.
//
// A rotation of the whole gyro (the antisymmetric part) looks like a rotation of all cameras relative to the
// IMU. If the rotations of the cameras are estimated too, only gravity distinguishes the two, and weakly:
// then the gyro's axes define the body's.

#include <Eigen/Core>

#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/smoother/cholesky.hpp"

namespace swiftlet {

inline constexpr int kGyroMatrixDim = 9;

class GyroIntrinsicsState {
 public:
  using Vector = Eigen::Matrix<double, kGyroMatrixDim, 1>;

  /// `offset`: its first column in every system. `body_axes`: the gyro's axes are those of the body, so its
  /// antisymmetric part is fixed.
  GyroIntrinsicsState(bool estimated, int offset, bool body_axes = false)
      : estimated_(estimated),
        offset_(offset),
        turn_sigma_(body_axes ? kFixedSigma : kGyroMatrixPriorSigma) {}

  [[nodiscard]] bool estimated() const { return estimated_; }
  /// Held: no step changes the matrix, and it adds nothing to the covariance. Its information from the motion
  /// is still collected in the prior.
  void setHeld(bool held) { held_ = held; }
  /// Information added to the diagonal of its columns before a system is solved.
  [[nodiscard]] double heldInformation() const { return held_ ? 1.0 / (kHeldSigma * kHeldSigma) : 0; }
  [[nodiscard]] int offset() const { return offset_; }
  [[nodiscard]] int dimension() const { return estimated_ ? kGyroMatrixDim : 0; }
  [[nodiscard]] const GyroIntrinsics& now() const { return now_; }

  /// Makes the current value the reference.
  void setReference() { reference_ = now_; }
  /// Makes the current value the reference, and adds the prior information to H of a new prior.
  void hold(MatrixMap H) {
    setReference();
    if (!estimated_) return;
    // Information on the sum and on the difference of two opposite entries, each divided by the square root
    // of 2.
    const double sum = 1.0 / (kGyroMatrixPriorSigma * kGyroMatrixPriorSigma);
    const double turn = 1.0 / (turn_sigma_ * turn_sigma_);
    for (int column = 0; column < 3; ++column) {
      for (int row = 0; row < 3; ++row) {
        const int here = offset_ + row + 3 * column;
        const int opposite = offset_ + column + 3 * row;
        H(here, here) = row == column ? sum : (sum + turn) / 2;
        if (row != column) H(here, opposite) = (sum - turn) / 2;
      }
    }
  }
  /// Value minus reference.
  [[nodiscard]] Vector deviation() const { return (now_.matrix - reference_.matrix).reshaped(); }
  /// Applies its part of a step.
  void retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
    if (estimated_) now_.matrix.reshaped() += step.segment<kGyroMatrixDim>(offset_);
  }
  void backup() { backup_ = now_; }
  void restore() { now_ = backup_; }

 private:
  static constexpr double kFixedSigma = 1e-4;  ///< rad, below what cameras can resolve
  static constexpr double kHeldSigma = 1e-7;   ///< outweighs all information of a window

  bool estimated_;
  bool held_ = false;
  int offset_;
  double turn_sigma_;
  GyroIntrinsics now_;
  GyroIntrinsics reference_;
  GyroIntrinsics backup_;
};

}  // namespace swiftlet
