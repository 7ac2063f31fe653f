#include "estimator/smoother/window_problem.hpp"

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kImuCapacity = 8192;  // samples: 20 s at 400 Hz, 8 s at 1 kHz
// The gauge: position and yaw of the first state define the world.
constexpr double kGaugeSigma = 1e-4;  // m, rad

}  // namespace

WindowProblem::WindowProblem(const Rig& given_rig, const ImuNoise& imu_noise, bool estimate_time_offset,
                             bool estimate_extrinsics, bool estimate_gyro)
    : rig(given_rig),
      noise(imu_noise),
      imu(kImuCapacity),
      extras(landmarks),
      calibration(given_rig, estimate_time_offset, estimate_extrinsics),
      intrinsics(estimate_gyro, calibration.dimension(), estimate_extrinsics) {}

void WindowProblem::clear() {
  window.clear();
  landmarks.clear();
  extras.clear();
  prior.clear();
}

void WindowProblem::assignOffsets() {
  dimension = window.assignOffsets(extras.assignOffsets(calibration.dimension() + intrinsics.dimension()));
}

int WindowProblem::offsetOf(std::uint8_t slot) const {
  if (slot == PriorBlock::kCalibration) return 0;
  if (slot == PriorBlock::kGyroIntrinsics) return intrinsics.offset();
  return slot < kMaxStates ? window.inSlot(slot).offset : extras.states()[slot - kMaxStates].offset;
}

void WindowProblem::placeCameras() {
  const std::array<SE3, kMaxCameras>& T_body_cam = calibration.T_body_cam();
  for (const std::uint8_t slot : window.order()) {
    const WindowState& state = window.inSlot(slot);
    RigPose& placed = rig_poses[slot];
    SE3 T = state.x.T_world_body;
    const double shift = calibration.timeOffset() - state.time_offset;
    placed.v_world = state.x.v_world_body;
    placed.omega_body = state.omega_body;
    if (shift != 0) {
      T.rotation = (T.rotation * expSo3(shift * state.omega_body)).normalized();
      T.translation += shift * state.x.v_world_body;
    }
    for (std::size_t c = 0; c < rig.camera_count; ++c) {
      placed.place(c, T_body_cam[c], T, calibration.readout(), state.scan);
    }
  }
}

LandmarkViews WindowProblem::viewsOf(std::span<const Sighting> sightings) const {
  return {sightings, rig_poses, calibration.T_body_cam(), calibration.layout()};
}

void WindowProblem::startPrior(const StartState& start) {
  prior.begin();
  if (calibration.dimension() > 0) prior.addBlock(PriorBlock::kCalibration, calibration.dimension(), {});
  if (intrinsics.estimated()) prior.addBlock(PriorBlock::kGyroIntrinsics, kGyroMatrixDim, {});
  prior.addBlock(window.newestSlot(), kStateDim, start.state);
  prior.allocate();
  MatrixMap H = prior.H();
  calibration.hold(H);
  intrinsics.hold(H);
  const int at = calibration.dimension() + intrinsics.dimension();
  const double tilt = 1.0 / (start.tilt_sigma * start.tilt_sigma);
  const double gauge = 1.0 / (kGaugeSigma * kGaugeSigma);
  // The rotation error is in body axes, where the vertical is R^T z.
  const Eigen::Vector3d up = start.state.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  H.block<3, 3>(at, at) = tilt * Eigen::Matrix3d::Identity() + (gauge - tilt) * up * up.transpose();
  for (int k = 0; k < 3; ++k) {
    H(at + 3 + k, at + 3 + k) = gauge;
    H(at + 6 + k, at + 6 + k) = 1.0 / (start.velocity_sigma * start.velocity_sigma);
    H(at + 9 + k, at + 9 + k) = 1.0 / (start.gyro_bias_sigma * start.gyro_bias_sigma);
    H(at + 12 + k, at + 12 + k) = 1.0 / (start.accel_bias_sigma * start.accel_bias_sigma);
  }
}

void WindowProblem::retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
  calibration.retract(step);
  intrinsics.retract(step);
  window.retract(step);
  extras.retract(step);
}

void WindowProblem::backup() {
  window.backup();
  extras.backup();
  calibration.backup();
  intrinsics.backup();
}

void WindowProblem::restore() {
  window.restore();
  calibration.restore();
  intrinsics.restore();
  extras.restore();
}

void WindowProblem::integrateLink(WindowState& state, const WindowState& previous) const {
  state.imu_factors = imu_excess.factors();
  state.imu = Preintegration(noise.times(state.imu_factors), previous.x.bias_gyro, previous.x.bias_accel,
                             intrinsics.now());
  static_cast<void>(
      state.imu.integrate(imu.around(previous.stamp, state.stamp), previous.stamp, state.stamp));
}

}  // namespace swiftlet
