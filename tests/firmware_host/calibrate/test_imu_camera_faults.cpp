// Bad data: each fault is named, and no result is called good.

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>

#include "tests/firmware_host/calibrate/simulated_calibration.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kRig = 204;

SessionSettings shortSettings() {
  SessionSettings settings;
  settings.seed = kRig;
  settings.duration = 20;
  settings.camera_rate = 10;
  return settings;
}

CalibrationSession faultySession(const SessionSettings& settings) {
  return {drawCalibrationRig(kRig, CameraKind::kPinholeRadtan), CalibrationTarget{}, settings};
}

bool isNamed(const ImuCameraSolution& solution, const std::string& words) {
  std::string all;
  for (const std::string& reason : solution.reasons) all += reason + "\n";
  CAPTURE(all);
  const bool found = all.find(words) != std::string::npos;
  CHECK(found);
  return found;
}

TEST_CASE("left-handed IMU axes are named") {
  SessionSettings settings = shortSettings();
  settings.imu_axes << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  CHECK(isNamed(calibrateImuCamera(batchInput(faultySession(settings))), "left-handed"));
}

TEST_CASE("stamps of another clock are named") {
  SessionSettings settings = shortSettings();
  settings.clock_offset = Duration::fromSeconds(13);
  CHECK(isNamed(calibrateImuCamera(batchInput(faultySession(settings))), "one clock"));
}

TEST_CASE("a clock that drifts is named") {
  SessionSettings settings = shortSettings();
  settings.clock_drift = 2e-4;
  CHECK(isNamed(calibrateImuCamera(batchInput(faultySession(settings))), "two clocks"));
}

TEST_CASE("a board of another size than told is named") {
  ImuCameraInput input = batchInput(faultySession(shortSettings()));
  input.target.size *= 1.03;
  CHECK(isNamed(calibrateImuCamera(input), "Measure the board"));
}

TEST_CASE("a rig that never turned is named") {
  SessionSettings settings = shortSettings();
  settings.turning = Turning::kNone;
  CHECK(!calibrateImuCamera(batchInput(faultySession(settings))).reasons.empty());
}

TEST_CASE("a rig that never rolled is named") {
  SessionSettings settings = shortSettings();
  settings.turning = Turning::kNoRoll;
  CHECK(isNamed(calibrateImuCamera(batchInput(faultySession(settings))), "roll"));
}

TEST_CASE("images that are too far apart are named") {
  SessionSettings settings = shortSettings();
  settings.duration = 40;
  settings.camera_rate = 4;
  CHECK(isNamed(calibrateImuCamera(batchInput(faultySession(settings))), "250 ms apart"));
}

TEST_CASE("too few views are named") {
  ImuCameraInput input = batchInput(faultySession(shortSettings()));
  input.views.resize(60);
  CHECK(isNamed(calibrateImuCamera(input), "images show enough of the board"));
}

}  // namespace
}  // namespace swiftlet
