// An estimated calibration, written and read again.

#include <catch2/catch.hpp>
#include <filesystem>

#include "drivers/calibration/calibration.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet;

TEST_CASE("calibration files: what was estimated is read again, what was not stays", "[calibration_files]") {
  const auto folder = std::filesystem::temp_directory_path() / "swiftlet_calibration_files";
  std::filesystem::remove_all(folder);
  Calibration given;
  given.rig = makeRig(GENERATE(RigKind::kEuroc, RigKind::kFisheye)).rig;
  given.noise.gyro_density = 3e-4;
  given.noise.rate_hz = 250;
  given.camera_rate_hz = {30, 0};
  // An IMU that is turned in its body and sits beside its origin.
  given.R_body_imu = expSo3({0.1, -0.7, 1.2}).toRotationMatrix();
  given.T_body_filebody.translation = {0.03, -0.02, 0.01};
  CalibrationEstimate estimate;
  estimate.camera_to_imu_shift = Duration::fromSeconds(-4.25e-3);
  for (std::size_t c = 0; c < 2; ++c) {
    estimate.T_body_cam[c] = given.rig.T_body_cam[c];
    estimate.T_body_cam[c].rotation = expSo3({0.004, 0.002, -0.003}) * estimate.T_body_cam[c].rotation;
    estimate.T_body_cam[c].translation.x() += 0.002;
  }
  estimate.shift_sigma = 1e-4;
  const bool stereo = GENERATE(true, false);  // one camera: the other stays as given
  estimate.rotation_sigma = {2e-4, stereo ? 3e-4 : 0};
  if (!stereo) estimate.T_body_cam[1] = SE3();

  writeEstimatedCalibration(folder.string(), given, estimate, 20);
  const Calibration read = readCalibration(folder.string());
  for (std::size_t c = 0; c < 2; ++c) {
    const SE3& expected = c == 0 || stereo ? estimate.T_body_cam[c] : given.rig.T_body_cam[c];
    CHECK(read.rig.T_body_cam[c].R().isApprox(expected.R(), 1e-12));
    CHECK((read.rig.T_body_cam[c].translation - expected.translation).norm() < 1e-12);
    CHECK(read.rig.camera[c].intrinsics().isApprox(given.rig.camera[c].intrinsics()));
    CHECK(read.rig.camera[c].distortion().isApprox(given.rig.camera[c].distortion()));
  }
  CHECK(read.rig.camera_to_imu_shift == estimate.camera_to_imu_shift);
  CHECK(read.R_body_imu.isApprox(given.R_body_imu, 1e-12));
  CHECK((read.T_body_filebody.translation - given.T_body_filebody.translation).norm() < 1e-12);
  CHECK(read.noise.gyro_density == Approx(3e-4));
  CHECK(read.camera_rate_hz[0] == 30);
  CHECK(read.camera_rate_hz[1] == 20);
  std::filesystem::remove_all(folder);
}

TEST_CASE("calibration files: both forms read back as what was written", "[calibration_files]") {
  const auto folder = std::filesystem::temp_directory_path() / "swiftlet_calibration_forms";
  std::filesystem::remove_all(folder);
  Calibration given;
  given.rig = makeRig(GENERATE(RigKind::kEuroc, RigKind::kFisheye)).rig;
  given.rig.camera_to_imu_shift = Duration::fromSeconds(3.5e-3);
  given.rig.readout = Duration::fromSeconds(20e-3);
  given.noise.gyro_walk = 3e-5;
  given.conversion[0] = "ds as equidistant: 0.001 px RMS, 0.002 px at most";
  given.camera_topic[0] = "/cam0";
  // An IMU that is turned in its body and sits beside its origin.
  given.R_body_imu = expSo3({0.1, -0.7, 1.2}).toRotationMatrix();
  given.T_body_filebody.translation = {0.03, -0.02, 0.01};
  const bool matrices = GENERATE(false, true);
  if (matrices) {
    given.gyro_matrix << 1.01, 0.002, -0.003, 0.004, 0.99, 0.005, -0.006, 0.001, 1.002;
    given.accel_matrix << 0.995, 0, 0, 0.002, 1.004, 0, -0.003, 0.001, 1.01;
    given.gyro_by_force(1, 2) = 2e-4;
  }
  writeCalibration(folder.string(), given, "found here");
  CHECK(test::contains(test::textOf(folder / "cam1/sensor.yaml"), "comment: \"found here\""));
  CHECK(test::contains(test::textOf(folder / "imu0/sensor.yaml"), "comment: found here"));
  const Calibration euroc = readCalibration(folder.string());
  const Calibration kalibr = readCalibration((folder / "camchain-imucam.yaml").string());
  CHECK(euroc.R_body_imu.isApprox(given.R_body_imu, 1e-12));
  CHECK((euroc.T_body_filebody.translation - given.T_body_filebody.translation).norm() < 1e-12);
  CHECK(kalibr.camera_topic[0] == "/cam0");
  // Kalibr's body is the IMU, axes and all.
  const SE3 T_imu_body(Eigen::Quaterniond(given.R_body_imu).conjugate(), Eigen::Vector3d::Zero());
  for (std::size_t c = 0; c < 2; ++c) {
    const SE3 in_imu = T_imu_body * given.rig.T_body_cam[c];
    CHECK((euroc.rig.T_body_cam[c].inverse() * given.rig.T_body_cam[c]).translation.norm() < 1e-12);
    CHECK((kalibr.rig.T_body_cam[c].inverse() * in_imu).translation.norm() < 1e-12);
    CHECK(kalibr.rig.T_body_cam[c].R().isApprox(in_imu.R(), 1e-12));
    for (const Calibration* read : {&euroc, &kalibr}) {
      CHECK(read->hasImuMatrices() == matrices);
      CHECK(read->gyro_matrix.isApprox(given.gyro_matrix, 1e-13));
      CHECK(read->gyro_by_force.isApprox(given.gyro_by_force, 1e-13));
      CHECK(read->accel_matrix.isApprox(given.accel_matrix, 1e-13));
      CHECK(read->rig.camera[c].kind() == given.rig.camera[c].kind());
      CHECK(read->rig.camera[c].intrinsics().isApprox(given.rig.camera[c].intrinsics()));
      CHECK(read->rig.camera[c].distortion().isApprox(given.rig.camera[c].distortion()));
      CHECK(read->rig.camera_to_imu_shift == given.rig.camera_to_imu_shift);
      CHECK(read->rig.readout == given.rig.readout);
      CHECK(read->noise.gyro_walk == given.noise.gyro_walk);
    }
  }
  std::filesystem::remove_all(folder);
}
