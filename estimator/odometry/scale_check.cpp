#include "estimator/odometry/scale_check.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace swiftlet {
namespace {

// Prior before the first keyframe.
constexpr double kVelocitySigma = 5.0;    // m/s, around the estimated velocity times the scale
constexpr double kScaleSigma = 1.0;       // relative
constexpr double kTiltSigma = 0.1;        // rad: a start in motion can be off by 6 degrees
constexpr double kAccelBiasSigma = 0.15;  // m/s^2
// Random walk of the scale error: 6 % in 10 s.
constexpr double kScaleWalk = 0.02;  // 1/sqrt(s)
constexpr double kTiltWalk = 1e-3;   // rad/sqrt(s)
// Before the scale is confirmed, evidence is discarded if the smoother has since corrected its scale by more
// than this (natural logarithm).
constexpr double kCorrected = 0.10;
// Keyframes closer together than this do not reveal a correction of the scale.
constexpr double kLeastDistance = 0.2;  // m
// In addition to the smoother's factor for correlated errors (track_correlation.hpp). The limits for a
// restart were tuned with both.
constexpr double kVisionInflation = 4.0;  // on the variance

}  // namespace

void ScaleCheck::reset() {
  forget();
  any_ = false;
  confirmed_ = false;
  old_.reset();
}

void ScaleCheck::forget() {
  x_.setZero();
  x_[kScale] = 1;
  P_.setZero();
  P_(kScale, kScale) = kScaleSigma * kScaleSigma;
  P_.diagonal().segment<2>(kTilt).setConstant(kTiltSigma * kTiltSigma);
  P_.diagonal().segment<3>(kBias).setConstant(kAccelBiasSigma * kAccelBiasSigma);
  corrected_ = 1;
}

// A prior around zero velocity would explain the path of a fast vehicle by a larger scale.
void ScaleCheck::forgetVelocity(const WindowState& state) {
  const Eigen::Vector3d v = state.has_motion ? state.x.v_world_body : Eigen::Vector3d::Zero();
  x_.segment<3>(kVelocity) = scale() * v;
  P_.topRows<3>() = v * P_.row(kScale);
  P_.leftCols<3>() = P_.topRows<3>().transpose().eval();
  P_.topLeftCorner<3, 3>() =
      P_(kScale, kScale) * v * v.transpose() + kVelocitySigma * kVelocitySigma * Eigen::Matrix3d::Identity();
}

double ScaleCheck::sigma() const { return std::sqrt(P_(kScale, kScale)); }

void ScaleCheck::update(Smoother& smoother) {
  const Window& window = smoother.states();
  const std::size_t settled = smoother.settled();
  if (settled < 2) return;
  const WindowState& i = window[settled - 2];
  const WindowState& j = window[settled - 1];
  if (any_ && j.frame_index == newest_) return;
  const bool follows = any_ && i.frame_index == newest_;
  any_ = true;
  newest_ = j.frame_index;
  if (!confirmed_) watchCorrections(window, settled);
  if (!follows || j.link != LinkKind::kImu || !i.has_motion || !j.has_motion) {
    // No IMU link from the last keyframe used: the velocity is unknown here.
    forgetVelocity(j);
    if (!follows) return;
  }
  Eigen::Matrix<double, 6, 6> covariance;
  if (j.link != LinkKind::kImu || !i.has_motion || !j.has_motion ||
      !smoother.relativeCovariance(settled - 2, settled - 1, covariance)) {
    return;
  }
  propagate(i, j.imu);
  measure(j.x.T_world_body.translation - i.x.T_world_body.translation,
          kVisionInflation * covariance.bottomRightCorner<3, 3>().trace() / 3);
  confirmed_ = confirmed_ || (sigma() < kKnown && std::abs(scale() - 1) < kAgrees);
}

// Displacements before and after a correction of the scale are not comparable.
void ScaleCheck::watchCorrections(const Window& window, std::size_t settled) {
  const auto find = [&](std::uint64_t frame) {
    std::size_t k = 0;
    while (k < settled && window[k].frame_index != frame) ++k;
    return k;
  };
  if (old_) {
    const std::size_t a = find(old_->first);
    const std::size_t b = find(old_->last);
    if (a < settled && b < settled) {
      corrected_ *= (window[b].x.T_world_body.translation - window[a].x.T_world_body.translation).norm() /
                    old_->distance;
    }
    if (std::abs(std::log(corrected_)) > kCorrected) {
      forget();
      forgetVelocity(window[settled - 2]);
    }
  }
  // Not the oldest keyframe, which can leave the window before the next call.
  const WindowState& first = window[1];
  const WindowState& last = window[settled - 1];
  const double distance = (last.x.T_world_body.translation - first.x.T_world_body.translation).norm();
  old_.reset();
  if (distance > kLeastDistance) old_ = Baseline{first.frame_index, last.frame_index, distance};
}

// Propagates to the next keyframe; `kMoved` becomes the displacement since the last one.
void ScaleCheck::propagate(const WindowState& i, const Preintegration& imu) {
  const double t = imu.duration();
  const Eigen::Matrix3d R = i.x.T_world_body.R();
  const Eigen::Vector3d bias = x_.segment<3>(kBias);
  const Eigen::Matrix<double, 9, 3> by_bias = imu.jacobianAccel();
  Matrix F = Matrix::Identity();
  F.block<3, 3>(kMoved, kMoved).setZero();
  F.block<3, 3>(kMoved, kVelocity) = t * Eigen::Matrix3d::Identity();
  for (int k = 0; k < 2; ++k) {
    F(kVelocity + k, kTilt + k) = t * noise_.gravity;
    F(kMoved + k, kTilt + k) = 0.5 * t * t * noise_.gravity;
  }
  F.block<3, 3>(kMoved, kBias) = R * by_bias.middleRows<3>(3);
  F.block<3, 3>(kVelocity, kBias) = R * by_bias.bottomRows<3>();
  const Eigen::Vector3d g(noise_.gravity * x_[kTilt], noise_.gravity * x_[kTilt + 1], -noise_.gravity);
  const Eigen::Vector3d velocity = x_.segment<3>(kVelocity);
  x_.segment<3>(kMoved) = t * velocity + 0.5 * t * t * g + R * imu.deltaPosition(i.x.bias_gyro, bias);
  x_.segment<3>(kVelocity) = velocity + t * g + R * imu.deltaVelocity(i.x.bias_gyro, bias);
  P_ = F * P_ * F.transpose();
  const Matrix9d Q = imu.covariance();
  P_.block<3, 3>(kMoved, kMoved) += R * Q.block<3, 3>(3, 3) * R.transpose();
  P_.block<3, 3>(kVelocity, kVelocity) += R * Q.block<3, 3>(6, 6) * R.transpose();
  const Eigen::Matrix3d cross = R * Q.block<3, 3>(3, 6) * R.transpose();
  P_.block<3, 3>(kMoved, kVelocity) += cross;
  P_.block<3, 3>(kVelocity, kMoved) += cross.transpose();
  P_(kScale, kScale) += t * kScaleWalk * kScaleWalk;
  P_.diagonal().segment<2>(kTilt).array() += t * kTiltWalk * kTiltWalk;
  P_.diagonal().segment<3>(kBias).array() += t * noise_.accel_walk * noise_.accel_walk;
}

void ScaleCheck::measure(const Eigen::Vector3d& displacement, double variance) {
  // 0 = s displacement - moved
  Eigen::Matrix<double, 3, kAll> H = Eigen::Matrix<double, 3, kAll>::Zero();
  H.col(kScale) = displacement;
  H.block<3, 3>(0, kMoved) = -Eigen::Matrix3d::Identity();
  const Eigen::Vector3d residual = -H * x_;
  const Eigen::Matrix<double, kAll, 3> PHt = P_ * H.transpose();
  Eigen::Matrix3d S = H * PHt;
  S.diagonal().array() += variance;
  const Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success) return;
  const Eigen::Matrix<double, 3, kAll> K = llt.solve(PHt.transpose());
  x_ += K.transpose() * residual;
  P_ -= PHt * K;
  P_ = 0.5 * (P_ + P_.transpose()).eval();
}

}  // namespace swiftlet
