#include "estimator/imu/stereo_start.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/start_parameters.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kLeastFrames = 3;
constexpr int kIterations = 6;
constexpr double kConverged = 1e-8;  // of a step, in the unknowns' own units
// Beyond this sigma of the tilt the equations said nothing.
constexpr double kUselessTilt = 0.5;  // rad

// Unknowns: those of StartParameters, then the first position's error o.
constexpr int kUnknowns = StartParameters::kSize + 3;
using Vector14d = Eigen::Matrix<double, kUnknowns, 1>;
using Matrix14d = Eigen::Matrix<double, kUnknowns, kUnknowns>;

struct Normal {
  Matrix14d H = Matrix14d::Zero();
  Vector14d b = Vector14d::Zero();
  double cost = 0;
  int rows = 0;

  void add(const Eigen::Matrix<double, 3, kUnknowns>& J, const Eigen::Vector3d& r, double sigma) {
    const double w = 1.0 / (sigma * sigma);
    H += w * J.transpose() * J;
    b += w * J.transpose() * r;
    cost += w * r.squaredNorm();
    rows += 3;
  }
};

void addFrame(const StartFrame& frame, const StartParameters& x, const Eigen::Vector3d& offset,
              const ImuNoise& noise, Normal& normal) {
  const Preintegration& imu = *frame.from_first;
  const StartPose pose = x.poseAt(imu, noise.gravity);
  const Matrix9d covariance = imu.covariance();
  Eigen::Matrix<double, 3, kUnknowns> J = Eigen::Matrix<double, 3, kUnknowns>::Zero();
  J.leftCols<StartParameters::kSize>() = pose.d_position;
  J.rightCols<3>().setIdentity();
  // The preintegration's own noise is correlated between frames; adding it to each is a fair bound.
  const double imu_variance = covariance.block<3, 3>(3, 3).trace() / 3.0;
  normal.add(J, pose.position + offset - frame.position,
             std::sqrt(frame.position_sigma * frame.position_sigma + imu_variance));
  if (frame.rotation_sigma <= 0) return;
  // Log(R_vision^T R(bg)): its derivative is that of the right error of R.
  J.setZero();
  J.middleCols<3>(StartParameters::kBiasGyro) = imu.jacobianGyro().topRows<3>();
  const double turn_variance = covariance.block<3, 3>(0, 0).trace() / 3.0;
  normal.add(J, logSo3(frame.rotation.conjugate() * pose.rotation),
             std::sqrt(frame.rotation_sigma * frame.rotation_sigma + turn_variance));
}

}  // namespace

Status solveStereoStart(std::span<const StartFrame> frames, const TiltEstimate& tilt, const ImuNoise& noise,
                        const StartPrior& prior, MotionStart& start) {
  const std::size_t count = std::min(frames.size(), kMaxStartFrames);
  if (count < kLeastFrames) return {StatusCode::kNotReady, "fewer than 3 frames after the first"};
  StartParameters x(tilt.up, prior);
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  const double offset_sigma = std::max(frames.front().position_sigma, 1e-6);
  Matrix14d information = Matrix14d::Zero();
  double cost = 0;
  int rows = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Normal normal;
    for (std::size_t k = 0; k < count; ++k) addFrame(frames[k], x, offset, noise, normal);
    cost = normal.cost;
    rows = normal.rows;
    x.addPrior(tilt, prior, normal.H.topLeftCorner<StartParameters::kSize, StartParameters::kSize>(),
               normal.b.head<StartParameters::kSize>());
    normal.H.diagonal().tail<3>().array() += 1.0 / (offset_sigma * offset_sigma);
    normal.b.tail<3>() += offset / (offset_sigma * offset_sigma);
    const Eigen::LLT<Matrix14d> llt(normal.H);
    if (llt.info() != Eigen::Success) return {StatusCode::kDegenerate, "start equations are singular"};
    const Vector14d step = -llt.solve(normal.b);
    if (!step.allFinite()) return {StatusCode::kNumerical, "start iteration diverged"};
    information = normal.H;
    x.retract(step.head<StartParameters::kSize>());
    offset += step.tail<3>();
    if (step.cwiseAbs().maxCoeff() < kConverged) break;
  }
  const Matrix14d covariance = information.llt().solve(Matrix14d::Identity());
  x.toMotionStart(covariance.topLeftCorner<StartParameters::kSize, StartParameters::kSize>(), start);
  start.residual_rms = std::sqrt(cost / std::max(1, rows - kUnknowns));
  if (!(start.tilt_sigma < kUselessTilt)) return {StatusCode::kDegenerate, "motion does not show gravity"};
  return okStatus();
}

NavState toNavState(const MotionStart& start, Stamp at, const StartPrior& prior) {
  NavState state;
  state.stamp = at;
  state.T_world_body = SE3(gravityAlignedRotation(start.up), Eigen::Vector3d::Zero());
  const Eigen::Matrix3d R = state.T_world_body.R();
  state.v_world_body = R * start.velocity;
  state.bias_gyro = start.bias_gyro;
  state.bias_accel = start.bias_accel;
  // v_world = R v_body: a tilt error phi turns it by -R hat(v_body) phi.
  Eigen::Matrix<double, kStateDim, 12> J = Eigen::Matrix<double, kStateDim, 12>::Zero();
  J.block<3, 3>(0, 0).setIdentity();
  J.block<3, 3>(6, 0) = -R * hat(start.velocity);
  J.block<3, 3>(6, 3) = R;
  J.block<6, 6>(9, 6).setIdentity();
  state.covariance = J * start.covariance * J.transpose();
  const double gauge = prior.gauge_sigma * prior.gauge_sigma;
  state.covariance.block<3, 3>(0, 0) += gauge * start.up * start.up.transpose();
  state.covariance.block<3, 3>(3, 3).diagonal().array() += gauge;
  return state;
}

}  // namespace swiftlet
