// The real seconds in the repository: a whole run with two cameras and with one, on any machine.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

constexpr int kImages = 80;
// What a run measures is 3 and 4 mm; on four seconds in a room anything beyond a centimetre is broken.
constexpr double kLargestError = 0.01;  // m, ATE
constexpr double kTiltError = 1.0;      // deg, RMS of the attitude

struct Expected {
  bool mono;
  double first_pose;  // s after the first image, at most
};

void checkRun(const Expected& expected) {
  const ScratchFolder folder(expected.mono ? "short_log_mono" : "short_log_stereo");
  ReplayRequest request;
  request.accuracy = runAccuracyJson;
  request.log = shortLog();
  request.out = folder.file("run");
  request.mono = expected.mono;
  const ReplayResult result = runReplay(request, Settings{});
  REQUIRE(result.finished);
  REQUIRE(result.has_pose);
  const double first_pose = result.summary["run"]["time_to_first_pose_s"].get<double>();
  CHECK(first_pose <= expected.first_pose);

  // From the first on, a pose for every image.
  int poses = 0;
  std::ifstream file(folder.file("run/odometry.tum"));
  for (std::string line; std::getline(file, line);) ++poses;
  CHECK(poses >= kImages - static_cast<int>(first_pose * 20 + 0.5));

  for (const char* trajectory : {"odometry", "states", "map"}) {
    INFO(trajectory);
    const auto& figures = result.summary["accuracy"][trajectory]["all"]["se3"];
    CHECK(figures["ate_m"]["rmse"].get<double>() < kLargestError);
    CHECK(figures["attitude_deg"]["rmse"].get<double>() < kTiltError);
  }
  CHECK(result.summary["health"].back()["health"] == "good");
}

TEST_CASE("four real seconds with two cameras: a pose from the first image on, within a centimetre") {
  checkRun({false, 0.0});
}

TEST_CASE("four real seconds with one camera: a pose within a second, within a centimetre") {
  checkRun({true, 1.0});
}

// The images' clock 40 ms behind the IMU's, eight of its periods, and a calibration that says so. The truth
// has the IMU's stamps.
TEST_CASE("images stamped long before their samples: an IMU between all, errors at the same instants") {
  constexpr std::int64_t kBehind = 40'000'000;  // ns
  const ScratchFolder folder("short_log_behind");
  const std::string log = folder.file("log");
  std::filesystem::copy(shortLog(), log, std::filesystem::copy_options::recursive);
  for (const std::string part : {"cam0", "cam1"}) {
    const std::string file = log + "/mav0/" + part + "/data.csv";
    std::istringstream given(test::textOf(file));
    std::string rows;
    for (std::string line; std::getline(given, line);) {
      const std::size_t comma = line.find(',');
      rows += line.front() == '#'
                  ? line
                  : std::to_string(std::stoll(line.substr(0, comma)) - kBehind) + line.substr(comma);
      rows += '\n';
    }
    std::ofstream(file) << rows;
  }
  for (const std::string camera : {"cam0", "cam1"}) {
    std::ofstream(log + "/mav0/" + camera + "/sensor.yaml", std::ios::app) << "timeshift_cam_imu: 0.04\n";
  }
  ReplayRequest request;
  request.accuracy = runAccuracyJson;
  request.log = log;
  request.out = folder.file("run");
  const ReplayResult result = runReplay(request, Settings{});
  REQUIRE(result.finished);
  CHECK(result.summary["health"].back()["health"] == "good");
  CHECK(result.summary["accuracy"]["odometry"]["all"]["se3"]["ate_m"]["rmse"].get<double>() < kLargestError);
}

}  // namespace
}  // namespace swiftlet
