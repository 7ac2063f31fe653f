#pragma once
// Scale and misalignment of the gyro in the window: zero, or estimated with columns of their own.
//
// Nine columns, the matrix by columns, after those of the cameras' calibration. The reference of the prior is
// the value at `hold`. Entries that no rotation excites stay at the prior, and the covariance includes their
// uncertainty. While the matrix is held, it adds nothing to the covariance.

#include <Eigen/Core>

#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/smoother/cholesky.hpp"

namespace swiftlet {

inline constexpr int kGyroMatrixDim = 9;

class GyroIntrinsicsState {
 public:
  using Vector = Eigen::Matrix<double, kGyroMatrixDim, 1>;

  /// `offset`: its first column in every system.
  GyroIntrinsicsState(bool estimated, int offset) : estimated_(estimated), offset_(offset) {}

  [[nodiscard]] bool estimated() const { return estimated_; }
  /// Active: the matrix is estimated from the motion, if enabled. Otherwise it is held.
  void setActive(bool active) { active_ = active; }
  [[nodiscard]] bool active() const { return estimated_ && active_; }
  [[nodiscard]] int offset() const { return offset_; }
  [[nodiscard]] int dimension() const { return estimated_ ? kGyroMatrixDim : 0; }
  [[nodiscard]] const GyroIntrinsics& now() const { return now_; }

  /// Makes the present value the reference, and adds the prior information to H of a new prior.
  void hold(MatrixMap H) {
    reference_ = now_;
    for (int k = 0; k < dimension(); ++k) {
      H(offset_ + k, offset_ + k) = 1.0 / (kGyroMatrixPriorSigma * kGyroMatrixPriorSigma);
    }
  }
  /// Value minus reference.
  [[nodiscard]] Vector deviation() const { return (now_.matrix - reference_.matrix).reshaped(); }
  /// Applies its columns of a step.
  void retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
    if (estimated_) now_.matrix.reshaped() += step.segment<kGyroMatrixDim>(offset_);
  }
  void backup() { backup_ = now_; }
  void restore() { now_ = backup_; }

 private:
  bool estimated_;
  bool active_ = true;
  int offset_;
  GyroIntrinsics now_;
  GyroIntrinsics reference_;
  GyroIntrinsics backup_;
};

}  // namespace swiftlet
