#include "tests/firmware_host/calibrate/simulated_calibration.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

std::string axisName(int k) { return std::string(1, "xyz"[k]); }

}  // namespace

ImuCameraInput batchInput(const CalibrationSession& session) {
  ImuCameraInput input;
  input.target = session.target();
  for (int k = 0; k < session.imageCount(); ++k) {
    for (BoardView& view : session.views(k)) {
      if (!view.corners.empty()) input.views.push_back(std::move(view));
    }
  }
  input.samples = session.imu().samples;
  input.noise = session.truth().noise;
  const Rig& rig = session.truth().rig;
  Random random(session.settings().seed, 7001);
  input.cameras.camera_count = rig.camera_count;
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    const CameraModel& lens = rig.camera[c];
    Eigen::Vector4d intrinsics = lens.intrinsics();
    for (int k = 0; k < 4; ++k) intrinsics[k] += 0.005 * lens.focal() * random.normal();
    Eigen::Vector4d distortion = lens.distortion();
    for (int k = 0; k < 4; ++k) distortion[k] *= 1 + 0.02 * random.normal();
    input.cameras.camera[c].model = {lens.kind(), lens.width(), lens.height(), intrinsics, distortion};
  }
  const Eigen::Vector3d turn(0.002 * random.normal(), 0.002 * random.normal(), 0.002 * random.normal());
  input.cameras.T_cam1_cam0 = SE3(expSo3(turn), Eigen::Vector3d(0.001, 0.001, -0.001)) * rig.T_cam1_cam0();
  return input;
}

double CalibrationErrors::worst(const std::string& unit, const std::string& part) const {
  double most = 0;
  for (const ValueError& value : values) {
    if (value.unit != unit || value.name.find(part) == std::string::npos) continue;
    most = std::max(most, std::abs(value.error));
  }
  return most;
}

CalibrationErrors errorsOf(const ImuCameraSolution& solution, const CalibrationSession& session) {
  const CalibrationRig& truth = session.truth();
  std::map<std::string, double> error;
  for (std::size_t c = 0; c < truth.rig.camera_count; ++c) {
    const std::string cam = "cam" + std::to_string(c);
    const bool radtan = truth.rig.camera[c].kind() == CameraKind::kPinholeRadtan;
    const std::array<std::string, 8> names{
        "fx", "fy", "cx", "cy", "k1", "k2", radtan ? "p1" : "k3", radtan ? "p2" : "k4"};
    for (int k = 0; k < 8; ++k) {
      const auto of = [k](const CameraModel& lens) {
        return k < 4 ? lens.intrinsics()[k] : lens.distortion()[k - 4];
      };
      error[cam + " " + names[static_cast<std::size_t>(k)]] =
          of(solution.rig.camera[c]) - of(truth.rig.camera[c]);
    }
    const SE3& found = solution.rig.T_body_cam[c];
    const SE3& real = truth.rig.T_body_cam[c];
    const Eigen::Vector3d turn = kDegreesPerRadian * logSo3(real.rotation.conjugate() * found.rotation);
    for (int k = 0; k < 3; ++k) {
      error["T_body_" + cam + " rotation " + axisName(k)] = turn[k];
      error["T_body_" + cam + " position " + axisName(k)] =
          1e3 * (found.translation[k] - real.translation[k]);
    }
  }
  error["time offset"] = 1e3 * (solution.rig.camera_to_imu_shift - truth.rig.camera_to_imu_shift).seconds();
  error["readout"] = 1e3 * (solution.rig.readout - truth.rig.readout).seconds();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const std::string entry =
          i == j ? " scale " + axisName(i) : " misalignment " + axisName(i) + axisName(j);
      error["gyro" + entry] = 100 * (solution.gyro_matrix(i, j) - truth.gyro_matrix(i, j));
      error["accel" + entry] = 100 * (solution.accel_matrix(i, j) - truth.accel_matrix(i, j));
    }
  }
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  double count = 0;
  const SimulatedImu& imu = session.imu();
  for (std::size_t k = 0; k < imu.samples.size(); ++k) {
    const Stamp stamp = imu.samples[k].stamp;
    if (stamp < solution.imu_residuals.front().stamp || stamp > solution.imu_residuals.back().stamp) continue;
    gyro += imu.bias_gyro[k];
    accel += imu.bias_accel[k];
    ++count;
  }
  for (int k = 0; k < 3; ++k) {
    error["gyro bias " + axisName(k)] = kDegreesPerRadian * (solution.gyro_bias[k] - gyro[k] / count);
    error["accel bias " + axisName(k)] = solution.accel_bias[k] - accel[k] / count;
  }

  CalibrationErrors errors;
  Eigen::VectorXd all(static_cast<Eigen::Index>(solution.values.size()));
  for (std::size_t k = 0; k < solution.values.size(); ++k) {
    const SolvedValue& value = solution.values[k];
    errors.values.push_back({value.name, value.unit, error.at(value.name), value.sigma});
    all[static_cast<Eigen::Index>(k)] = error.at(value.name);
  }
  // Scaled to sigmas first: the units differ by orders of magnitude.
  const Eigen::VectorXd sigmas = solution.covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation =
      sigmas.cwiseInverse().asDiagonal() * solution.covariance * sigmas.cwiseInverse().asDiagonal();
  const Eigen::VectorXd scaled = all.cwiseQuotient(sigmas);
  errors.nees = scaled.dot(correlation.ldlt().solve(scaled));
  return errors;
}

}  // namespace swiftlet
