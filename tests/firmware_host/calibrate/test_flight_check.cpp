// The check of a calibration by a flight: a true one is not called moved, and a wrong one is never said to
// hold.

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/calibration/calibration.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/track_file.hpp"
#include "drivers/simulated/folder_writer.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/lab/calibrate/check/check_run.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

void fly(const std::string& folder, double duration, std::uint64_t seed) {
  SimulationSettings settings;
  settings.seed = seed;
  settings.flight.duration = duration;
  const std::filesystem::path place = std::filesystem::path(folder) / "mav0" / "tracks0";
  std::filesystem::create_directories(place);
  TrackWriter writer((place / "data.csv").string());
  REQUIRE(
      simulateTracksToFolder(settings, folder, [&](const TrackedFrame& frame) { writer.write(frame); }).ok());
  writer.close();
}

CheckResult checkWith(const std::string& log, const std::string& folder, const Calibration& calibration) {
  writeCalibration(folder, calibration);
  CheckRequest request;
  request.log = log;
  request.calibration = folder;
  return checkCalibration(request, Settings{});
}

const CheckedValue& valueOf(const CheckResult& result, const std::string& name) {
  for (const CheckedValue& value : result.values) {
    if (value.name == name) return value;
  }
  FAIL("no value " << name);
  return result.values.front();
}

TEST_CASE("The run of a check does not replace a flight") {
  const ScratchFolder scratch("check_of_flight");
  CheckRequest request;
  request.log = scratch.file("log");
  fly(request.log, 2, 77);
  request.out = scratch.file("flight");
  { const RunClaim flown(request.out, RunKind::kFlight, false); }
  const std::string states = request.out + "/states.csv";
  std::ofstream(states) << "of the flight";
  CHECK_THROWS_WITH(checkCalibration(request, Settings{}), Catch::Contains("already holds a flight"));
  CHECK(test::textOf(states) == "of the flight");
}

TEST_CASE("A flight says what a calibration is off by") {
  const ScratchFolder scratch("flight_check");
  const std::string log = scratch.file("log");
  fly(log, 16, 77);
  const Calibration truth = readCalibration(log);

  const CheckResult right = checkWith(log, scratch.file("right"), truth);
  INFO(checkText(right));
  REQUIRE(right.pieces.size() >= 3);
  CHECK(right.verdict != CheckVerdict::kMoved);
  for (const CheckedValue& value : right.values) {
    INFO(value.name << " " << value.change << " +- " << value.sigma);
    CHECK(std::abs(value.change) < 4 * value.sigma + 0.1 * value.limit);
  }

  // All at once: time, camera 1 turned, a longer baseline.
  Calibration wrong = truth;
  wrong.rig.camera_to_imu_shift = Duration::fromMilliseconds(5);
  const SE3 T_cam0_cam1 = truth.rig.T_body_cam[0].inverse() * truth.rig.T_body_cam[1];
  const double turn = 0.1 / 57.3;
  wrong.rig.T_body_cam[1] =
      truth.rig.T_body_cam[0] * SE3(T_cam0_cam1.rotation * expSo3({0, turn, 0}), T_cam0_cam1.translation);
  const CheckResult off = checkWith(log, scratch.file("wrong"), wrong);
  INFO(checkText(off));
  CHECK(off.verdict == CheckVerdict::kMoved);
  const CheckedValue& shift = valueOf(off, "time shift of the cameras");
  CHECK(shift.verdict == CheckVerdict::kMoved);
  CHECK(shift.change == Approx(-5).margin(4 * shift.sigma + 0.2));
  const CheckedValue& about_y = valueOf(off, "camera 1 against camera 0: turn about its y");
  CHECK(about_y.verdict == CheckVerdict::kMoved);
  CHECK(about_y.change == Approx(-0.1).margin(4 * about_y.sigma + 0.005));
}

}  // namespace
}  // namespace swiftlet
