// A recorded flight played as a camera's ROS 2 driver publishes it, by another DDS implementation in a
// process of its own: what `fly` makes of it beside a plain replay, and what `doctor` says.

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstdint>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/device/host_clocks.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/runs/doctor_run.hpp"
#include "firmware_host/runs/fly_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "firmware_host/runs/vehicle_calibration.hpp"
#include "tests/drivers/dds/peer_process.hpp"
#include "tests/drivers/dds/test_topics.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

Settings vehicleOf(const std::string& log) {
  Settings settings;
  settings.vehicle.calibration = log;
  settings.ros2.domain = static_cast<int>(test::ownDomain());
  settings.ros2.driver = "realsense";
  settings.imu_link.topic = test::kTopicImu;
  settings.mesh.enabled = false;
  settings.realtime.lock_memory = false;
  settings.cameras.camera_info = kCameraInfoOff;
  return settings;
}

/// The driver's process, and the stop of who flies by it once it has played all.
class PlayedDriver {
 public:
  PlayedDriver(const std::string& log, std::vector<std::string> arguments) {
    arguments.push_back("log=" + log);
    arguments.push_back("domain=" + std::to_string(test::ownDomain()));
    process_.emplace(SWIFTLET_DDS_DRIVER, arguments);
    constexpr int kLooks = 2000;  // 20 s: busy machines start processes slowly
    for (int i = 0; i < kLooks && said_.find("ready") == std::string::npos; ++i) {
      sleepFor(Duration::fromMilliseconds(10));
      said_ += process_->poll();
    }
    watcher_ = std::thread([this] {
      while (!stop_.load() && said_.find("ended") == std::string::npos) {
        said_ += process_->poll();
        sleepFor(Duration::fromMilliseconds(10));
      }
      ended_.store(true);
    });
  }
  ~PlayedDriver() {
    stop_.store(true);
    if (watcher_.joinable()) watcher_.join();
  }
  PlayedDriver(const PlayedDriver&) = delete;
  PlayedDriver& operator=(const PlayedDriver&) = delete;

  [[nodiscard]] const std::atomic<bool>& ended() const { return ended_; }

  /// After the end.
  struct Report {
    Duration moved;                           ///< from the log's clock to CLOCK_MONOTONIC
    std::array<std::uint64_t, 3> withheld{};  ///< of camera 0, camera 1 and the IMU
  };
  Report report() {
    watcher_.join();
    said_ += process_->finish();
    Report report;
    std::istringstream words(said_);
    std::int64_t wall = 0;
    std::int64_t log = 0;
    std::string word;
    REQUIRE(words >> word >> word >> wall >> log);
    report.moved = Duration{wall - log} - readHostClocks().realtime_ahead;
    REQUIRE(words >> word >> word);
    for (std::uint64_t& withheld : report.withheld) {
      std::uint64_t count = 0;
      REQUIRE(words >> count >> withheld >> count);
    }
    return report;
  }

 private:
  std::optional<test::PeerProcess> process_;
  std::string said_;
  std::thread watcher_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
};

double ate(const std::string& folder, const Trajectory& truth, const Settings& settings, std::size_t& poses) {
  const Trajectory estimate = readWholeTrajectory(folder + "/odometry.tum", "");
  poses = estimate.size();
  return accuracyOf(estimate, truth, accuracyOptions(settings.evaluation, AlignKind::kSe3))
      .absolute.translation.rmse;
}

struct Manner {
  const char* name;
  std::vector<std::string> arguments;
  bool apart = false;
  bool compressed = false;
};

void fly(const std::string& log, double seconds, const Manner& manner) {
  CAPTURE(manner.name);
  const ScratchFolder folder(std::string("topic_flight_") + manner.name);
  Settings settings = vehicleOf(log);
  if (manner.apart) {
    settings.imu_link.topic = test::kTopicGyro;
    settings.imu_link.accel_topic = test::kTopicAccel;
  }
  if (manner.compressed) {
    settings.cameras.topic0 = std::string(test::kTopicCameras[0]) + "/compressed";
    settings.cameras.topic1 = std::string(test::kTopicCameras[1]) + "/compressed";
  }
  std::vector<std::string> arguments = manner.arguments;
  arguments.push_back("seconds=" + std::to_string(seconds));
  FlyResult flown;
  PlayedDriver driver(log, arguments);
  FlyRequest request;
  request.out = folder.file("flight");
  request.stop = &driver.ended();
  flown = runFlight(request, settings);
  for (const std::string& line : flown.missing) std::cout << line << '\n';
  REQUIRE(flown.missing.empty());
  CHECK(flown.faultless);
  REQUIRE(flown.has_pose);
  const PlayedDriver::Report played = driver.report();
  ReplayRequest replay;
  replay.log = log;
  replay.out = folder.file("replay");
  if (seconds > 0) replay.until = seconds;
  static_cast<void>(runReplay(replay, settings));
  Trajectory truth_of_log = openLog(log)->groundTruth();
  Trajectory truth = truth_of_log;
  for (TrajectoryPoint& point : truth) point.stamp = point.stamp + played.moved;
  std::size_t poses_flown = 0;
  std::size_t poses_replayed = 0;
  const double in_flight = ate(folder.file("flight"), truth, settings, poses_flown);
  const double replayed = ate(folder.file("replay"), truth_of_log, settings, poses_replayed);
  const auto& devices = flown.summary.at("counters").at("devices");
  std::cout << "topic_flight: " << manner.name << ": ATE " << in_flight << " m of " << poses_flown
            << " poses in flight, " << replayed << " m of " << poses_replayed
            << " in a plain replay; withheld " << played.withheld[0] << ", " << played.withheld[1] << ", "
            << played.withheld[2] << '\n'
            << "  camera 0 " << devices.at("camera0").dump() << "\n  camera 1 "
            << devices.at("camera1").dump() << "\n  IMU " << devices.at("imu").at("link").dump() << '\n';
  // Differences below a millimetre mean nothing on this log.
  CHECK(in_flight <= std::max(1.1 * replayed, replayed + 0.001));
  CHECK(poses_flown + played.withheld[0] + played.withheld[1] + 10 >= poses_replayed);
  CHECK(devices.at("camera0").at("missed") == played.withheld[0]);
  CHECK(devices.at("camera1").at("missed") == played.withheld[1]);
  CHECK(devices.at("imu").at("link").at("missing_samples") == played.withheld[2]);
  // Whose library allocates and locks stands below the flight path.
  for (const auto& thread : flown.summary.at("executor").at("threads")) {
    const auto name = thread.at("name").get<std::string>();
    if (name == "imu" || name.starts_with("camera")) {
      CHECK(thread.at("wanted_priority") == settings.realtime.low_priority);
    }
  }
}

std::optional<std::string> realLog() {
  std::optional<std::string> log = findLog("euroc_mh01_20s");
  if (!log) skipCase("no euroc_mh01_20s", "SWIFTLET_DATA=FOLDER toolchain/test.sh");
  return log;
}

TEST_CASE("a flight on topics is as accurate as a replay of its log") {
  const std::optional<std::string> log = realLog();
  if (log) fly(*log, 5, {"short", {"late=30"}});
}

TEST_CASE("a whole flight on topics, in each manner that drivers have", "[.][long]") {
  const std::optional<std::string> log = realLog();
  if (!log) return;
  const auto manner = GENERATE(Manner{"united", {}}, Manner{"apart", {"imu=apart"}, true},
                               Manner{"compressed", {"images=compressed"}, false, true},
                               Manner{"late", {"late=30"}}, Manner{"lost", {"lose=37"}});
  fly(*log, 0, manner);
}

TEST_CASE("doctor shows what topics give, and which ones there are") {
  PlayedDriver driver(shortLog(), {"lead=1"});
  Settings settings = vehicleOf(shortLog());
  // Of rectified images P alone counts.
  settings.cameras.camera_info = kCameraInfoUse;
  const CameraModel told = vehicleCalibration(settings).rig.camera[0];
  CHECK(told.intrinsics() == Eigen::Vector4d(458.654, 457.296, 367.215, 248.375));
  CHECK(told.distortion().isZero(0));
  settings.cameras.camera_info = kCameraInfoCheck;
  DoctorRequest request;
  request.seconds = 2;
  const DoctorReport report = examine(request, settings);
  std::cout << report.connected.text("connected") << report.vehicle.text("this vehicle");
  const auto found = [&](const MachineReport& part, const std::string& what) {
    std::string all;
    for (const MachineLine& line : part.lines) {
      if (line.what == what) all += line.found + '\n';
    }
    return all;
  };
  CHECK_THAT(found(report.connected, "topic"),
             Catch::Contains("/camera/camera/imu sensor_msgs/msg/Imu") &&
                 Catch::Contains("/camera/camera/infra1/image_rect_raw sensor_msgs/msg/Image"));
  CHECK_THAT(found(report.vehicle, "camera 0 images"),
             Catch::Contains("752x480 GREY") && Catch::Contains("image_rect_raw (ROS 2)"));
  CHECK_THAT(found(report.vehicle, "camera 0 timing"), Catch::Contains("from stamp to arrival"));
  CHECK_THAT(found(report.vehicle, "IMU clock"), Catch::Contains("wall clock"));
  // Said to be rectified: P is EuRoC's without its distortion.
  CHECK_THAT(
      found(report.vehicle, "calibration"),
      Catch::Contains("camera 1: the calibration's lens and /camera/camera/infra2/camera_info differ") &&
          Catch::Contains("rectified"));
}

}  // namespace
}  // namespace swiftlet
