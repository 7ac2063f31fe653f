// Recorded flights played out in real time, images through GStreamer pipelines with the log's times of
// capture, samples over a serial port: what `fly` makes of them beside a plain replay, and what `doctor`
// says.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/runs/doctor_run.hpp"
#include "firmware_host/runs/fly_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/hil/played_vehicle.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

double ate(const std::string& folder, const Trajectory& truth, const Settings& settings, std::size_t& poses) {
  const Trajectory estimate = readWholeTrajectory(folder + "/odometry.tum", "");
  poses = estimate.size();
  return accuracyOf(estimate, truth, accuracyOptions(settings.evaluation, AlignKind::kSe3))
      .absolute.translation.rmse;
}

TEST_CASE("a flight on pipelines is as accurate as a replay of its log") {
  const std::optional<std::string> log = findLog("euroc_mh01_20s");
  if (!log) {
    skipCase("no euroc_mh01_20s", "SWIFTLET_DATA=FOLDER toolchain/test.sh");
    return;
  }
  const ScratchFolder folder("pipeline_flight");
  Trajectory truth, truth_of_log;
  Settings settings;
  FlyResult flown;
  {
    PlayedVehicle vehicle(*log, folder.file("imu"), Duration::fromMilliseconds(4000));
    settings = vehicle.settings;
    FlyRequest request;
    request.out = folder.file("flight");
    request.stop = &vehicle.ended();
    flown = runFlight(request, settings);
    truth = vehicle.truth();
    truth_of_log = vehicle.truthOfLog();
  }
  for (const std::string& line : flown.missing) std::cout << line << '\n';
  REQUIRE(flown.missing.empty());
  CHECK(flown.faultless);
  REQUIRE(flown.has_pose);
  ReplayRequest replay;
  replay.log = *log;
  replay.out = folder.file("replay");
  static_cast<void>(runReplay(replay, settings));
  std::size_t poses_flown = 0;
  std::size_t poses_replayed = 0;
  const double in_flight = ate(folder.file("flight"), truth, settings, poses_flown);
  const double replayed = ate(folder.file("replay"), truth_of_log, settings, poses_replayed);
  const auto& devices = flown.summary.at("counters").at("devices");
  std::cout << "pipeline_flight: ATE " << in_flight << " m of " << poses_flown << " poses in flight, "
            << replayed << " m of " << poses_replayed << " in a plain replay\n"
            << "pipeline_flight: camera 0 " << devices.at("camera0").dump() << '\n';
  // Differences below a millimetre mean nothing on this log.
  CHECK(std::abs(in_flight - replayed) <= std::max(0.1 * replayed, 0.001));
  CHECK(poses_flown + 10 >= poses_replayed);
  // Below the flight path, whose sensors stand at 45.
  for (const auto& thread : flown.summary.at("executor").at("threads")) {
    const auto name = thread.at("name").get<std::string>();
    if (name == "imu") CHECK(thread.at("wanted_priority") == settings.realtime.sensor_priority);
    if (name.starts_with("camera")) CHECK(thread.at("wanted_priority") == settings.realtime.low_priority);
  }
}

TEST_CASE("doctor shows what a pipeline gives, and when it goes and returns") {
  const ScratchFolder folder("pipeline_doctor");
  PlayedVehicle vehicle(shortLog(), folder.file("imu"), Duration::fromMilliseconds(1500));
  DoctorRequest request;
  request.seconds = 4;
  std::thread breaker([&] {
    sleepFor(Duration::fromMilliseconds(3500));
    vehicle.feed(1).die();
  });
  const DoctorReport report = examine(request, vehicle.settings);
  breaker.join();
  std::cout << report.vehicle.text("this vehicle");
  const auto found = [&](const std::string& what) {
    std::string all;
    for (const MachineLine& line : report.vehicle.lines) {
      if (line.what == what) all += line.found + '\n';
    }
    return all;
  };
  CHECK_THAT(found("camera 0 images"), Catch::Contains("752x480 GREY") && Catch::Contains("20 Hz") &&
                                           Catch::Contains("feedsrc (GStreamer)"));
  CHECK_THAT(found("camera 0 stamps"), Catch::Contains("of the start of exposure"));
  CHECK_THAT(found("camera 0 timing"), Catch::Contains("99 %") && Catch::Contains("from stamp to arrival"));
  CHECK_THAT(found("camera 0 frames"), Catch::Contains("received"));
  CHECK_THAT(found("in this time"), Catch::Contains("camera 1 (feedsrc feed=1") && Catch::Contains("gone") &&
                                        Catch::Contains("works again"));
}

}  // namespace
}  // namespace swiftlet
