#include <unistd.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "drivers/simulated/folder_writer.hpp"
#include "drivers/simulated/simulated_source.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

using test::textOf;

class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name)
      : path_(fs::temp_directory_path() / ("swiftlet_" + name + "_" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

std::vector<std::string> rowsOf(const fs::path& path) {
  std::istringstream text(textOf(path));
  std::vector<std::string> rows;
  for (std::string line; std::getline(text, line);) {
    if (!line.empty() && line[0] != '#') rows.push_back(line);
  }
  return rows;
}

SimulationSettings shortFlight() {
  SimulationSettings settings;
  settings.flight.duration = 0.61;
  settings.rig = RigKind::kForward;
  settings.paint.texel = 0.03;
  return settings;
}

TEST_CASE("the folder holds a whole EuRoC log, the same on any number of threads") {
  SimulationSettings settings = shortFlight();
  const TemporaryFolder a("simulated_a");
  const TemporaryFolder b("simulated_b");
  std::string message;
  int progress = 0;
  settings.threads = 1;
  REQUIRE(simulateToFolder(
              settings, a.path(), [&](int done, int) { progress = done; }, &message)
              .ok());
  settings.threads = 3;
  REQUIRE(simulateToFolder(settings, b.path(), {}, &message).ok());
  CHECK(progress == 11);

  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(a.path())) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const fs::path relative = fs::relative(entry.path(), a.path());
    INFO(relative.string());
    CHECK(textOf(entry.path()) == textOf(b.path() / relative));
  }
  const std::size_t images = 22;
  const std::size_t cameras = 4;
  const std::size_t imu_and_truth = 3;
  const std::size_t depth = 5;
  const std::size_t labels = 6;
  const std::size_t about_the_world = 5;
  CHECK(files == images + cameras + imu_and_truth + depth + labels + about_the_world);

  const fs::path mav = a.path() / "mav0";
  const auto left = rowsOf(mav / "cam0/data.csv");
  REQUIRE(left.size() == 11);
  CHECK(left.front() == "1700000000100000000,1700000000100000000.jpg");
  CHECK(rowsOf(mav / "cam1/data.csv") == left);
  for (const std::string& row : left) CHECK(fs::exists(mav / "cam0/data" / row.substr(row.find(',') + 1)));
  CHECK(rowsOf(mav / "imu0/data.csv").size() == 123);
  const auto truth = rowsOf(mav / "state_groundtruth_estimate0/data.csv");
  REQUIRE(truth.size() == 123);
  CHECK(std::count(truth[0].begin(), truth[0].end(), ',') == 16);
  CHECK(rowsOf(mav / "depth0/data.csv").size() == 3);
  CHECK(textOf(mav / "cam0/sensor.yaml").find("distortion_model: radial-tangential") != std::string::npos);
  CHECK(rowsOf(mav / "labels0/labels.csv").size() == kLabelCount);
  CHECK(textOf(a.path() / "truth/mesh.ply").starts_with("ply\nformat ascii 1.0\n"));
  CHECK(textOf(mav / "cam0/sensor.yaml") == textOf(a.path() / "truth/cam0.yaml"));
}

TEST_CASE("faults, offsets and turned extrinsics are written as asked") {
  SimulationSettings settings = shortFlight();
  settings.depth_every = 0;
  settings.format = ImageFormat::kPng;
  settings.faults = {{FaultKind::kCameraMissing, {0.2, 0.34}, 1}, {FaultKind::kImuGap, {0.1, 0.3}, -1}};
  settings.image_stamp_offset = Duration::fromMilliseconds(5);
  settings.camera_turn_deg[0] = {0, 0, 0.5};
  const TemporaryFolder folder("simulated_faults");
  std::string message;
  REQUIRE(simulateToFolder(settings, folder.path(), {}, &message).ok());
  const fs::path mav = folder.path() / "mav0";
  const auto left = rowsOf(mav / "cam0/data.csv");
  CHECK(left.size() == 11);
  CHECK(left.front() == "1700000000105000000,1700000000105000000.png");
  CHECK(rowsOf(mav / "cam1/data.csv").size() == 8);
  CHECK(rowsOf(mav / "imu0/data.csv").size() == 123 - 40);
  CHECK(rowsOf(mav / "state_groundtruth_estimate0/data.csv").size() == 123);
  CHECK(textOf(mav / "cam0/sensor.yaml") != textOf(folder.path() / "truth/cam0.yaml"));
  CHECK(textOf(mav / "cam1/sensor.yaml") == textOf(folder.path() / "truth/cam1.yaml"));
  CHECK(textOf(folder.path() / "truth/simulation.yaml").find("timeshift_cam_imu: -0.005") !=
        std::string::npos);

  const SimulatedFlight flight(settings);
  const Eigen::AngleAxisd turn(flight.givenRig().T_body_cam[0].rotation *
                               flight.trueRig().T_body_cam[0].rotation.conjugate());
  CHECK(turn.angle() * 180 / M_PI == Approx(0.5));
}

TEST_CASE("tracks are written without rendering") {
  SimulationSettings settings = shortFlight();
  settings.faults = {{FaultKind::kBlackout, {0.18, 0.22}, -1}, {FaultKind::kCameraMissing, {0.38, 0.42}, -1}};
  const TemporaryFolder folder("simulated_tracks");
  std::vector<TrackedFrame> frames;
  int progress = 0;
  REQUIRE(simulateTracksToFolder(
              settings, folder.path(), [&](const TrackedFrame& frame) { frames.push_back(frame); },
              [&](int done, int) { progress = done; })
              .ok());
  CHECK(progress == 11);
  // Without any image there is no frame; dark images make a frame that saw nothing.
  REQUIRE(frames.size() == 10);
  std::size_t dark = 0;
  for (const TrackedFrame& frame : frames) {
    dark += frame.features.empty() ? 1 : 0;
    CHECK(frame.camera_present[0] == !frame.features.empty());
    if (!frame.features.empty()) CHECK(frame.features.size() > 100);
  }
  CHECK(dark == 1);
  CHECK(frames.front().stamp.ns == 1700000000100000000);
  CHECK(fs::exists(folder.path() / "mav0/cam0/sensor.yaml"));
  CHECK_FALSE(fs::exists(folder.path() / "mav0/cam0/data"));
}

TEST_CASE("tracks do not go into a folder with another flight's images") {
  const TemporaryFolder folder("simulated_mixed");
  fs::create_directories(folder.path() / "mav0/cam0");
  std::ofstream(folder.path() / "mav0/cam0/data.csv") << "#timestamp [ns],filename\n";
  std::string message;
  const auto sink = [](const TrackedFrame&) {};
  const Status status = simulateTracksToFolder(shortFlight(), folder.path(), sink, {}, &message);
  CHECK(status.code == StatusCode::kFailed);
  CHECK(message.find("cam0/data.csv") != std::string::npos);
  CHECK_FALSE(fs::exists(folder.path() / "mav0/imu0"));
}

TEST_CASE("bad settings and unwritable folders are said by name") {
  SimulationSettings settings = shortFlight();
  settings.camera_rate = 0;
  std::string message;
  CHECK(simulateToFolder(settings, "unused", {}, &message).code == StatusCode::kInvalidInput);
  CHECK(message.find("camera_rate") != std::string::npos);
  settings = shortFlight();
  settings.given_motion = "no_such_motion.csv";
  CHECK(simulateToFolder(settings, "unused", {}, &message).code == StatusCode::kFailed);
  CHECK(message.find("no_such_motion.csv") != std::string::npos);
  CHECK(simulateToFolder(shortFlight(), "/proc/no_folder", {}, &message).code == StatusCode::kFailed);
  CHECK(message.find("/proc/no_folder/mav0/imu0: ") == 0);
}

TEST_CASE("the stream gives samples and frames in time order") {
  SimulationSettings settings = shortFlight();
  settings.faults = {{FaultKind::kBlackout, {0.2, 0.3}, -1}, {FaultKind::kCameraMissing, {0.3, 0.4}, 0}};
  SimulatedSource source(settings);
  ImuSample sample;
  CameraFrame frame;
  Stamp last{0};
  int samples = 0;
  std::array<int, 2> frames{};
  for (;;) {
    const SimulatedSource::Item item = source.next(sample, frame);
    if (item == SimulatedSource::Item::kEnd) break;
    const Stamp stamp = item == SimulatedSource::Item::kImu ? sample.stamp : frame.stamp;
    CHECK(stamp >= last);
    last = stamp;
    if (item == SimulatedSource::Item::kImu) {
      ++samples;
      continue;
    }
    ++frames[frame.camera];
    double mean = 0;
    for (int y = 0; y < frame.image.height; ++y) {
      for (int x = 0; x < frame.image.width; ++x) mean += frame.image.row(y)[x];
    }
    mean /= frame.image.width * frame.image.height;
    const double t = (frame.stamp - source.flight().settings().start).seconds();
    if (t > 0.2 - 1e-6 && t < 0.3 - 1e-6) {
      CHECK(mean < 5);
    } else {
      CHECK(mean > 20);
      CHECK(mean < 160);
    }
  }
  CHECK(samples == 123);
  CHECK(frames[0] == 9);
  CHECK(frames[1] == 11);
}

TEST_CASE("low light is darker, noisier, and still exposed") {
  SimulationSettings settings = shortFlight();
  settings.low_light = true;
  const SimulatedFlight flight(settings);
  CHECK(flight.settings().sensor.light == Approx(0.05));
  CHECK(flight.settings().render.exposure == Approx(0.01));
}

}  // namespace
}  // namespace swiftlet
