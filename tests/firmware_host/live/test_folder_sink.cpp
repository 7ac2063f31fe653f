// A live recording comes back as it went in.

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "firmware_host/outputs/recorder/folder_sink.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

Calibration calibration() {
  Calibration calibration;
  calibration.rig = makeRig(RigKind::kEuroc).rig;
  calibration.noise.rate_hz = 400;
  calibration.noise.gyro_density = 3e-4;
  return calibration;
}

std::uint8_t pixel(std::uint32_t camera, int frame, int x, int y) {
  return static_cast<std::uint8_t>(31U * camera + 7U * static_cast<unsigned>(frame) +
                                   static_cast<unsigned>(x) + 3U * static_cast<unsigned>(y));
}

/// As a camera's thread hands it over.
void hand(FolderSink& sink, std::uint32_t camera, int frame, Stamp stamp, int width, int height) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels.push_back(pixel(camera, frame, x, y));
  }
  CameraFrame image;
  image.camera = camera;
  image.stamp = stamp;
  image.image = {pixels.data(), width, height, width};
  sink.takeImage(image, {});
}

ImuSample sampleNumber(int i) {
  ImuSample sample;
  sample.stamp = {987'654'321'098'765 + i * 2'500'001LL};
  sample.gyro = {0.1234567890123 * i, -1.0 / (i + 3), 1e-9};
  sample.accel = {9.80665, -0.3333333333333333 * i, 123.456};
  return sample;
}

TEST_CASE("a recorded folder is read back with the same stamps, samples and pixels") {
  const ScratchFolder folder("folder_sink");
  Calibration given = calibration();
  given.rig.camera_to_imu_shift = Duration{-1'234'567};
  constexpr int kSamples = 60;
  constexpr int kFrames = 3;
  constexpr double kDigits = 1e-9;  // more than the f32 that sensors send
  const Stamp first = sampleNumber(10).stamp + Duration{17};
  const auto stampOf = [&](int frame) { return first + Duration{50'000'123LL * frame}; };
  const int width = given.rig.camera[0].width();
  const int height = given.rig.camera[0].height();
  {
    FolderSink sink(folder.file("log"), given, 20);
    for (int i = 0; i < kSamples; ++i) sink.takeImu(sampleNumber(i), {}, {});
    for (int f = 0; f < kFrames; ++f) {
      for (std::uint32_t c = 0; c < 2; ++c) hand(sink, c, f, stampOf(f), width, height);
    }
    sink.finish();
    CHECK(sink.counters().samples == kSamples);
    CHECK(sink.counters().images[0] == kFrames);
    CHECK(sink.counters().images[1] == kFrames);
    CHECK(sink.counters().samples_lost + sink.counters().images_lost[0] + sink.counters().images_lost[1] ==
          0);
    CHECK_FALSE(sink.failed());
  }
  LogOptions options;
  options.imu_after_last_image = true;
  const auto log = openLog(folder.file("log"), options);
  CHECK(log->imuNoise().rate_hz == given.noise.rate_hz);
  CHECK(log->imuNoise().gyro_density == given.noise.gyro_density);
  CHECK(log->rig().camera_to_imu_shift == given.rig.camera_to_imu_shift);
  CHECK((log->rig().T_body_cam[1].translation - given.rig.T_body_cam[1].translation).norm() < 1e-9);
  CHECK(log->rig().T_body_cam[1].rotation.angularDistance(given.rig.T_body_cam[1].rotation) < 1e-9);
  int samples = 0;
  std::array<int, 2> frames{};
  SensorMessage message;
  while (log->next(message)) {
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      const ImuSample wanted = sampleNumber(samples++);
      CHECK(sample->stamp == wanted.stamp);
      CHECK((sample->gyro - wanted.gyro).norm() < kDigits * wanted.gyro.norm());
      CHECK((sample->accel - wanted.accel).norm() < kDigits * wanted.accel.norm());
      continue;
    }
    const auto& image = std::get<CameraFrame>(message);
    const int frame = frames.at(image.camera)++;
    CHECK(image.stamp == stampOf(frame));
    REQUIRE(image.image.width == width);
    REQUIRE(image.image.height == height);
    int wrong = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::uint8_t got = image.image.data[static_cast<std::ptrdiff_t>(y) * image.image.stride + x];
        wrong += got == pixel(image.camera, frame, x, y) ? 0 : 1;
      }
    }
    CHECK(wrong == 0);
  }
  CHECK(samples == kSamples);
  CHECK(frames == std::array{kFrames, kFrames});
}

TEST_CASE("a rig without a calibration is recorded without sensor files") {
  const ScratchFolder folder("folder_sink_bare");
  Calibration given = calibration();
  given.bare = true;
  {
    FolderSink sink(folder.file("log"), given, 20);
    sink.takeImu(sampleNumber(0), {}, {});
    hand(sink, 0, 0, sampleNumber(0).stamp, given.rig.camera[0].width(), given.rig.camera[0].height());
    sink.finish();
  }
  for (const char* sensor : {"cam0", "cam1", "imu0"}) {
    const std::filesystem::path place = std::filesystem::path(folder.file("log")) / "mav0" / sensor;
    CHECK(std::filesystem::exists(place / "data.csv"));
    CHECK_FALSE(std::filesystem::exists(place / "sensor.yaml"));
  }
}

TEST_CASE("what finds no room is counted, and all that is counted as written is there") {
  const ScratchFolder folder("folder_sink_full");
  const Calibration given = calibration();
  constexpr int kImages = 200;  // compression takes longer than a copy: the ring fills
  constexpr int kSamples = 100'000;
  FolderSink::Counters counters;
  {
    FolderSink sink(folder.file("log"), given, 20);
    const CameraModel& camera = given.rig.camera[0];
    const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(camera.width() * camera.height()));
    CameraFrame image;
    image.image = {pixels.data(), camera.width(), camera.height(), camera.width()};
    for (int i = 0; i < kImages; ++i) {
      image.stamp = {1'000'000'000LL + i};
      sink.takeImage(image, {});
    }
    for (int i = 0; i < kSamples; ++i) sink.takeImu(sampleNumber(i), {}, {});
    sink.finish();
    counters = sink.counters();
  }
  CHECK(counters.images_lost[0] > 0);
  CHECK(counters.images[0] + counters.images_lost[0] == kImages);
  CHECK(counters.samples + counters.samples_lost == kSamples);
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.file("log/mav0/cam0/data")))
    files += entry.path().extension() == ".png" ? 1 : 0;
  CHECK(files == counters.images[0]);
  const auto lines = [&](const std::string& name) {
    std::ifstream file(folder.file(name));
    std::uint64_t count = 0;
    for (std::string line; std::getline(file, line);) ++count;
    return count - 1;  // its header
  };
  CHECK(lines("log/mav0/cam0/data.csv") == counters.images[0]);
  CHECK(lines("log/mav0/imu0/data.csv") == counters.samples);
}

TEST_CASE("a folder with a recording is refused and not touched") {
  const ScratchFolder folder("folder_sink_old");
  std::filesystem::create_directories(folder.file("mav0/imu0"));
  std::ofstream(folder.file("mav0/imu0/data.csv")) << "old";
  CHECK_THROWS_WITH(FolderSink(folder.path(), calibration(), 20),
                    Catch::Contains("already holds a recording") && Catch::Contains("--out"));
  std::ifstream file(folder.file("mav0/imu0/data.csv"));
  std::string text;
  std::getline(file, text);
  CHECK(text == "old");
}

TEST_CASE("a folder that cannot be written is refused by name") {
  // Not by rights, which root does not want for: below a file nobody makes a folder.
  const ScratchFolder folder("folder_sink_file");
  std::ofstream(folder.file("file")) << "a file";
  CHECK_THROWS_WITH(
      FolderSink(folder.file("file/below"), calibration(), 20),
      Catch::Contains("file/below") && Catch::Contains("cannot be written") && Catch::Contains("--out"));
}

TEST_CASE("a disk that goes ends the recording with the reason, and the devices go on") {
  const ScratchFolder folder("folder_sink_gone");
  const Calibration given = calibration();
  FolderSink sink(folder.file("log"), given, 20);
  std::filesystem::remove_all(folder.file("log/mav0/cam0/data"));
  const int width = given.rig.camera[0].width();
  const int height = given.rig.camera[0].height();
  for (int i = 0; i < 300; ++i) hand(sink, 0, i, {1'000 + i}, width, height);
  for (int wait = 0; wait < 1000 && !sink.failed(); ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  CHECK(sink.failed());
  hand(sink, 0, 301, {2'000}, width, height);
  hand(sink, 1, 0, {2'000}, width, height);
  CHECK_THROWS_WITH(sink.finish(), Catch::Contains("writing stopped before the recording ended") &&
                                       Catch::Contains("Free space"));
}

}  // namespace
}  // namespace swiftlet
