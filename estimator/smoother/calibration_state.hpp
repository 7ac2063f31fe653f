#pragma once
// The calibration of the window: given, or estimated with its own columns.
//
// Variables: time offset (t_imu = t_image + offset, s) together with the readout of a rolling shutter (s),
// and T_body_cam of each camera; error state and columns as in calibration_columns.hpp. The reference of the
// prior is the value at `hold`.

#include <Eigen/Core>
#include <array>

#include "estimator/camera/rig.hpp"
#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/cholesky.hpp"

namespace swiftlet {

class CalibrationState {
 public:
  using Vector = Eigen::Matrix<double, kMaxCalibrationDim, 1>;

  CalibrationState(const Rig& rig, bool estimate_time_offset, bool estimate_extrinsics);

  [[nodiscard]] const CalibrationLayout& layout() const { return layout_; }
  [[nodiscard]] int dimension() const { return layout_.dimension(); }
  [[nodiscard]] double timeOffset() const { return now_.time_offset; }
  [[nodiscard]] double readout() const { return now_.readout; }
  [[nodiscard]] const std::array<SE3, kMaxCameras>& T_body_cam() const { return now_.T_body_cam; }

  /// Makes the current values the reference.
  void setReference() { reference_ = now_; }
  /// Makes the current values the reference, and adds the prior information of a calibration to H of a new
  /// prior.
  void hold(MatrixMap H);
  /// Values [-] reference, in the first dimension() rows.
  [[nodiscard]] Vector deviation() const;
  /// Applies the first dimension() rows of a step.
  void retract(const Eigen::Ref<const Eigen::VectorXd>& step);
  void backup() { backup_ = now_; }
  void restore() { now_ = backup_; }

 private:
  void holdBaseline(MatrixMap H) const;

  struct Values {
    double time_offset = 0;
    double readout = 0;
    std::array<SE3, kMaxCameras> T_body_cam;
  };

  CalibrationLayout layout_;
  Values now_;
  Values reference_;
  Values backup_;
};

}  // namespace swiftlet
