// Videos with their IMU as logs: GoPro's metadata bit by bit and against samples that another reader took out
// of the same file, a phone's log, and a flight of what was imported.

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/evaluation/position_accuracy.hpp"
#include "firmware_host/lab/import/gpmf.hpp"
#include "firmware_host/lab/import/import_run.hpp"
#include "firmware_host/lab/import/motion_of_video.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using test::messageOf;
using Bytes = std::vector<std::uint8_t>;

Bytes entry(const std::string& key, char type, int size, int count, const Bytes& data) {
  Bytes bytes(key.begin(), key.end());
  bytes.push_back(static_cast<std::uint8_t>(type));
  bytes.push_back(static_cast<std::uint8_t>(size));
  bytes.push_back(static_cast<std::uint8_t>(count >> 8));
  bytes.push_back(static_cast<std::uint8_t>(count & 255));
  bytes.insert(bytes.end(), data.begin(), data.end());
  bytes.resize((bytes.size() + 3) / 4 * 4);
  return bytes;
}

Bytes words(const std::vector<int>& values) {
  Bytes bytes;
  for (const int value : values) {
    bytes.push_back(static_cast<std::uint8_t>((value >> 8) & 255));
    bytes.push_back(static_cast<std::uint8_t>(value & 255));
  }
  return bytes;
}

Bytes joined(const std::vector<Bytes>& parts) {
  Bytes bytes;
  for (const Bytes& part : parts) bytes.insert(bytes.end(), part.begin(), part.end());
  return bytes;
}

Bytes nested(const std::string& key, const std::vector<Bytes>& parts) {
  const Bytes inner = joined(parts);
  return entry(key, 0, 1, static_cast<int>(inner.size()), inner);
}

Bytes payload(const std::string& orientation) {
  const Bytes letters(orientation.begin(), orientation.end());
  const Bytes accel = nested(
      "STRM", {entry("TSMP", 'L', 4, 1, {0, 0, 1, 2}), entry("STNM", 'c', 1, 5, {'A', 'c', 'c', 'e', 'l'}),
               entry("SCAL", 's', 2, 1, words({100})),
               entry("ORIN", 'c', 1, static_cast<int>(letters.size()), letters),
               entry("ACCL", 's', 6, 2, words({100, -200, 300, 400, 500, -600}))});
  const Bytes gyro = nested("STRM", {entry("SCAL", 's', 2, 3, words({10, 20, 40})),
                                     entry("GYRO", 's', 6, 1, words({10, 20, -40}))});
  const Bytes other =
      nested("STRM", {entry("SCAL", 'l', 4, 1, {0, 0, 0, 0}), entry("GPSU", 'U', 16, 1, Bytes(16))});
  return nested("DEVC", {entry("DVNM", 'c', 1, 6, {'C', 'a', 'm', 'e', 'r', 'a'}), other, accel, gyro});
}

TEST_CASE("a payload of GPMF gives scaled samples in the sensor's axes", "[import]") {
  const std::optional<GpmfPayload> read = readGpmf(payload(""));
  REQUIRE(read);
  REQUIRE(read->accel.values.size() == 2);
  CHECK(read->accel.values[1] == Eigen::Vector3d(4, 5, -6));
  CHECK(read->accel.counted);
  CHECK(read->accel.before == 256);
  CHECK(!read->gyro.counted);
  CHECK(read->gyro.values.at(0) == Eigen::Vector3d(1, 1, -1));
  // The first channel is y, the second x reversed.
  CHECK(readGpmf(payload("YxZ"))->accel.values[0] == Eigen::Vector3d(2, 1, 3));
  CHECK(!readGpmf(payload("XXZ")));
  CHECK(!readGpmf(payload("ABC")));
}

TEST_CASE("a payload that is cut anywhere is refused", "[import]") {
  const Bytes whole = payload("YxZ");
  for (std::size_t n = 1; n < whole.size(); ++n) CHECK(!readGpmf(std::span(whole).first(n)));
}

TEST_CASE("a phone's lines are read, and a broken one is named", "[import]") {
  std::string text;
  for (int i = 0; i < 20; ++i) {
    text += R"({"sensor":{"type":"gyroscope","values":[0.1,0.2,0.3]},"time":)" +
            std::to_string(100 + 0.01 * i) + "}\n";
    text += R"({"sensor":{"type":"accelerometer","values":[0,0,9.8]},"time":)" +
            std::to_string(100.001 + 0.01 * i) + "}\n";
    text += R"({"frames":[{"cameraInd":0},{"cameraInd":1,"time":)" + std::to_string(100.002 + 0.01 * i) +
            R"(}],"number":1,"time":)" + std::to_string(100.001 + 0.01 * i) + "}\n\n";
  }
  text += R"({"gps":{"latitude":60},"time":1})"
          "\n";
  const PhoneLog log = readPhoneLog("data.jsonl", text);
  CHECK(log.samples.size() == 19);
  CHECK(log.images[0].size() == 20);
  CHECK(log.images[1].at(1).ns == 100012000000);
  const std::string without_values = "{\"sensor\":{\"type\":\"gyroscope\"},\"time\":3}\n";
  CHECK(messageOf([&] { (void)readPhoneLog("data.jsonl", text + without_values); }).find("data.jsonl:82:") !=
        std::string::npos);
}

/// Of the shared data; the case is skipped without it.
std::optional<std::string> karmaFile(const std::string& name) {
  const std::optional<std::string> folder = findLog("gopro_karma");
  if (!folder) {
    skipCase("no gopro_karma in the folder of logs", kRunWithData);
    return std::nullopt;
  }
  return *folder + "/" + name;
}

/// The calibration of the data's README.
std::string karmaCalibration(const ScratchFolder& scratch) {
  fs::create_directories(scratch.file("calibration"));
  std::ofstream(scratch.file("calibration") + "/camchain.yaml")
      << "cam0:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: []\n"
         "  intrinsics: [557, 557, 426.5, 239.5]\n  resolution: [854, 480]\n  timeshift_cam_imu: -0.025\n"
         "  T_cam_imu:\n  - [0, -1, 0, 0]\n  - [-1, 0, 0, 0]\n  - [0, 0, -1, 0]\n  - [0, 0, 0, 1]\n";
  // The noise of an IMU of its class, as no data sheet is known.
  std::ofstream(scratch.file("calibration") + "/imu.yaml")
      << "accelerometer_noise_density: 0.01\naccelerometer_random_walk: 0.0002\n"
         "gyroscope_noise_density: 0.001\ngyroscope_random_walk: 4.0e-06\nupdate_rate: 397.0\n";
  return scratch.file("calibration");
}

TEST_CASE("a GoPro's video gives the samples that another reader took out of it, and it flies", "[import]") {
  const std::optional<std::string> video = karmaFile("karma.mp4");
  if (!video) return;
  const ScratchFolder scratch("import");
  const std::string log = scratch.file("log");
  REQUIRE(test::run({"import", *video, "--calibration", karmaCalibration(scratch), "--out", log}) == 0);
  const auto source = openLog(log);
  CHECK(source->imageCount() == 362);
  LogCounters counters;
  LogWarnings warnings;
  const auto theirs = readImuFile(*karmaFile("imu0.csv"), counters, warnings);
  const auto ours = readImuFile(log + "/mav0/imu0/data.csv", counters, warnings);
  REQUIRE(theirs.size() - ours.size() < 5);  // ends where the accelerometer does
  // Theirs are spread evenly over the video: within two of its images of ours.
  double worst_gyro = 0;
  double worst_time = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    worst_gyro = std::max(worst_gyro, (ours[i].gyro - theirs[i].gyro).norm());
    worst_time = std::max(worst_time, std::abs((ours[i].stamp - theirs[i].stamp).seconds()));
  }
  CHECK(worst_gyro < 1e-7);
  CHECK(worst_time < 0.012);
  const std::string run = scratch.file("run");
  static_cast<void>(
      test::run({"replay", log, "--out", run}));  // one camera, 12 s: its scale stays unconfirmed
  PositionAccuracyOptions options;
  options.reach = Duration::fromSeconds(5);
  const PositionAccuracy accuracy =
      positionAccuracy(readEstimate(run + "/odometry.tum"),
                       readPositions(*karmaFile("position.csv"), counters, warnings), options);
  std::printf("karma: rigid error %.2f m over %.1f m\n", accuracy.absolute.translation.rmse,
              accuracy.absolute.path_length);
  CHECK(accuracy.pairs > 25);
  CHECK(accuracy.absolute.translation.rmse < 1.5);
}

TEST_CASE("a phone's folder becomes a log with the stamps of its lines", "[import]") {
  const std::optional<std::string> video = karmaFile("karma.mp4");
  if (!video) return;
  const ScratchFolder scratch("import_phone");
  fs::create_directories(scratch.file("phone"));
  fs::create_symlink(fs::absolute(*video), scratch.file("phone") + "/data.mp4");
  std::ofstream lines(scratch.file("phone") + "/data.jsonl");
  for (int i = 0; i < 30; ++i) {
    const std::string time = "1000." + std::to_string(1000 + 33 * i).substr(1);
    lines << R"({"sensor":{"type":"gyroscope","values":[0.1,0.2,0.3]},"time":)" << time << "}\n"
          << R"({"sensor":{"type":"accelerometer","values":[0,0,9.8]},"time":)" << time << "}\n"
          << R"({"frames":[{"cameraInd":0}],"time":)" << time << "}\n";
  }
  lines.close();
  ImportRequest request;
  request.video = scratch.file("phone");
  request.out = scratch.file("log");
  const ImportResult result = importVideo(request);
  CHECK(result.images == 30);
  CHECK(result.samples == 30);
  CHECK(result.warnings.size() == 1);
  CHECK(fs::exists(request.out + "/mav0/cam0/data/1000033000000.png"));
  CHECK(fs::exists(request.out + "/mav0/imu0/data.csv"));
}

TEST_CASE("a calibration for another size of the second camera's video is refused", "[import]") {
  const std::optional<std::string> video = karmaFile("karma.mp4");
  if (!video) return;
  const ScratchFolder scratch("import_sizes");
  fs::create_directories(scratch.file("phone"));
  for (const char* name : {"/data.mp4", "/data2.mp4"}) {
    fs::create_symlink(fs::absolute(*video), scratch.file("phone") + name);
  }
  std::ofstream lines(scratch.file("phone") + "/data.jsonl");
  for (int i = 0; i < 3; ++i) {
    lines << R"({"sensor":{"type":"gyroscope","values":[0.1,0.2,0.3]},"time":)" << i << "}\n"
          << R"({"sensor":{"type":"accelerometer","values":[0,0,9.8]},"time":)" << i << "}\n"
          << R"({"frames":[{"cameraInd":0},{"cameraInd":1}],"time":)" << i << "}\n";
  }
  lines.close();
  ImportRequest request;
  request.video = scratch.file("phone");
  request.calibration = karmaCalibration(scratch);
  std::ofstream(request.calibration + "/camchain.yaml", std::ios::app)
      << "cam1:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: []\n"
         "  intrinsics: [557, 557, 320, 240]\n  resolution: [640, 480]\n  timeshift_cam_imu: -0.025\n"
         "  T_cam_imu:\n  - [0, -1, 0, 0.1]\n  - [-1, 0, 0, 0]\n  - [0, 0, -1, 0]\n  - [0, 0, 0, 1]\n";
  request.out = scratch.file("log");
  CHECK(messageOf([&] { (void)importVideo(request); }).find("camera 1 has 640x480, but ") !=
        std::string::npos);
  CHECK(!fs::exists(request.out));
}

TEST_CASE("a phone's log without times of its images is refused", "[import]") {
  const ScratchFolder scratch("import_no_frames");
  fs::create_directories(scratch.file("phone"));
  std::ofstream(scratch.file("phone") + "/data.mp4") << "";
  std::ofstream lines(scratch.file("phone") + "/data.jsonl");
  for (int i = 0; i < 30; ++i) {
    lines << R"({"sensor":{"type":"gyroscope","values":[0.1,0.2,0.3]},"time":)" << i << "}\n"
          << R"({"sensor":{"type":"accelerometer","values":[0,0,9.8]},"time":)" << i << "}\n";
  }
  lines.close();
  ImportRequest request;
  request.video = scratch.file("phone");
  request.out = scratch.file("log");
  CHECK(messageOf([&] {
          (void)importVideo(request);
        }).find("data.jsonl: frames: has no times of the images of data.mp4") != std::string::npos);
}

TEST_CASE("what cannot be imported is named, and nothing is left", "[import]") {
  const std::optional<std::string> video = karmaFile("karma.mp4");
  if (!video) return;
  const ScratchFolder scratch("import_faults");
  ImportRequest request;
  request.out = scratch.file("log");
  const auto message = [&] {
    const std::string text = messageOf([&] { (void)importVideo(request); });
    CHECK(!fs::exists(request.out));
    CHECK(!fs::exists(request.out + ".part"));
    return text;
  };
  request.video = scratch.file("none.mp4");
  CHECK(message().find("none.mp4: cannot be read as a video") != std::string::npos);
  const Bytes bytes = test::bytesOf(*video);
  request.video = scratch.file("cut.mp4");
  std::ofstream(request.video, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size() / 2));
  CHECK(message().find("cut.mp4: cannot be read as a video") != std::string::npos);
  request.video = *video;
  request.imu = scratch.file("imu.csv");
  std::ofstream(request.imu) << "#timestamp [ns],wx,wy,wz,ax,ay,az\n1403636579000000000,0,0,0,0,0,9.8\n"
                                "1403636579005000000,0,0,0,0,0,9.8\n";
  CHECK(message().find("--first-image") != std::string::npos);
  request.imu.clear();
  fs::create_directories(request.out + "/mav0");
  CHECK(messageOf([&] { (void)importVideo(request); }).find("already holds a log") != std::string::npos);
}

}  // namespace
}  // namespace swiftlet
