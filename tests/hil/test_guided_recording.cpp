// A bare rig's session in front of a board, played out in real time through GStreamer pipelines and a serial
// port: `record --calibrate` without any calibration.

#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/simulated/session_folder.hpp"
#include "firmware_host/lab/calibrate/guidance/guided_recording.hpp"
#include "firmware_host/runs/record_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/hil/played_vehicle.hpp"

namespace swiftlet {
namespace {

TEST_CASE("a rig without a calibration is recorded with guidance") {
  const ScratchFolder folder("guided_recording");
  SessionFolderSettings session;
  session.rig = RigKind::kForward;
  session.session.duration = 2.5;
  session.calibrated = true;  // for the player alone
  std::string message;
  REQUIRE(simulateSessionToFolder(CalibrationTarget{}, session, folder.file("session"), {}, &message).ok());

  std::vector<std::string> lines;
  GuidedRecording guidance(CalibrationTarget{}, [&](const std::string& line) { lines.push_back(line); });
  RecordResult result;
  {
    PlayedVehicle vehicle(folder.file("session"), folder.file("imu"), Duration::fromMilliseconds(1500));
    Settings settings = vehicle.settings;
    settings.vehicle.calibration.clear();
    settings.cameras.resolution = "640x400";
    RecordRequest request;
    request.out = folder.file("recording");
    request.stop = &vehicle.ended();
    request.watcher = &guidance;
    result = runRecord(request, settings);
  }
  for (const std::string& line : result.missing) WARN(line);
  REQUIRE(result.missing.empty());
  CHECK(result.cameras == 2);
  CHECK(result.written.images[0] >= 45);  // the session's 47, beside black ones before
  CHECK(result.written.images_lost[0] + result.written.images_lost[1] == 0);
  CHECK(result.written.samples >= 400);
  const std::filesystem::path recording(folder.file("recording"));
  CHECK(std::filesystem::exists(recording / "mav0/cam1/data.csv"));
  CHECK_FALSE(std::filesystem::exists(recording / "mav0/cam0/sensor.yaml"));
  CHECK_FALSE(hasCalibration(recording.string()));

  // The guidance saw the board in both, and did not find so short a session enough.
  CHECK(guidance.looks() >= 3);
  CHECK(guidance.samplesLost() == 0);
  REQUIRE_FALSE(guidance.missing().empty());
  for (const std::string& line : guidance.missing()) {
    CHECK(line.find("has not seen the board") == std::string::npos);
  }
  CHECK(lines.size() >= 2);
}

}  // namespace
}  // namespace swiftlet
