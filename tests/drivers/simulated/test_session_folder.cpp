#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "drivers/simulated/session_folder.hpp"
#include "drivers/simulated/simulated_flight.hpp"
#include "drivers/target/target_file.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::textOf;

TEST_CASE("a session's folder is that of a bare rig, with the truth beside it") {
  const fs::path folder = fs::temp_directory_path() / "swiftlet_session_folder";
  fs::remove_all(folder);
  CalibrationTarget target;
  target.columns = 5;
  SessionFolderSettings settings;
  settings.rig = RigKind::kRandomPinhole;
  settings.rig_seed = 12;
  settings.session.duration = 0.35;
  std::string message;
  const Status status = simulateSessionToFolder(target, settings, folder.string(), {}, &message);
  INFO(message);
  REQUIRE(status.ok());

  CHECK_FALSE(fs::exists(folder / "mav0/cam0/sensor.yaml"));
  CHECK_FALSE(hasCalibration(folder.string()));
  const Calibration truth = readCalibration((folder / "truth/calibration").string());
  const CalibrationRig drawn = drawCalibrationRig(12, CameraKind::kPinholeRadtan);
  REQUIRE(truth.rig.camera_count == 2);
  for (std::size_t c = 0; c < 2; ++c) {
    CHECK((truth.rig.camera[c].intrinsics() - drawn.rig.camera[c].intrinsics()).norm() < 1e-6);
    CHECK((truth.rig.T_body_cam[c].translation - drawn.rig.T_body_cam[c].translation).norm() < 1e-9);
  }
  CHECK(std::abs((truth.rig.camera_to_imu_shift - drawn.rig.camera_to_imu_shift).ns) <= 1);
  CHECK(std::abs((truth.rig.readout - drawn.rig.readout).ns) <= 1000);
  CHECK(readTarget((folder / "truth/board.yaml").string()).columns == 5);
  const std::string list = textOf(folder / "mav0/cam1/data.csv");
  CHECK(std::count(list.begin(), list.end(), '\n') == 1 + 4);  // at 0.1, 0.15, 0.2 and 0.25 s
  const std::string image = list.substr(list.rfind(',') + 1, list.size() - list.rfind(',') - 2);
  const std::string bytes = textOf(folder / "mav0/cam1/data" / image);
  CHECK(bytes.size() > 5000);

  // The same bytes on one thread.
  settings.threads = 1;
  settings.calibrated = true;
  REQUIRE(simulateSessionToFolder(target, settings, folder.string(), {}, &message).ok());
  CHECK(textOf(folder / "mav0/cam1/data" / image) == bytes);
  CHECK(fs::exists(folder / "mav0/cam0/sensor.yaml"));

  settings.exposure = 0.2;
  CHECK(simulateSessionToFolder(target, settings, folder.string(), {}, &message).code ==
        StatusCode::kInvalidInput);
  CHECK(message.find("exposure") != std::string::npos);
  fs::remove_all(folder);
}

TEST_CASE("a flight of a random rig has that rig's lenses, IMU and clock") {
  SimulationSettings settings;
  settings.rig = RigKind::kRandomFisheye;
  settings.rig_seed = 9;
  settings.flight.duration = 3;
  const SimulatedFlight flight(settings);
  const CalibrationRig drawn = drawCalibrationRig(9, CameraKind::kEquidistant);
  CHECK(flight.trueRig().camera[1].distortion() == drawn.rig.camera[1].distortion());
  CHECK(flight.trueRig().camera_to_imu_shift == drawn.rig.camera_to_imu_shift);
  CHECK(flight.trueRig().readout == drawn.rig.readout);
  CHECK(flight.settings().imu.gyro_matrix == drawn.gyro_matrix);
  CHECK(flight.settings().imu.noise.accel_density == drawn.noise.accel_density);
  // Camera 0 looks ahead: level, but for what the flight itself tilts.
  const SE3 T_world_cam = flight.trajectory().pose(1.5) * flight.trueRig().T_body_cam[0];
  CHECK(std::abs((T_world_cam.rotation * Eigen::Vector3d::UnitZ()).z()) < 0.4);
  CHECK((T_world_cam.rotation * Eigen::Vector3d::UnitY()).z() < -0.9);
}

}  // namespace
}  // namespace swiftlet
