// A live recording as MCAP: what comes in is read back, and what is cut is whole up to its last chunk.

#include <catch2/catch.hpp>
#include <filesystem>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/outputs/recorder/mcap_sink.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

const std::string kLog = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";

/// The first second of a log, as devices would hand it.
struct Recorded {
  explicit Recorded(const std::string& file) {
    LogOptions options;
    const auto log = openLog(kLog, options);
    McapSink sink(file, log->calibration());
    SensorMessage message;
    while (frames < 40 && log->next(message)) {
      if (const auto* sample = std::get_if<ImuSample>(&message)) {
        sink.takeImu(*sample, {}, {});
        ++samples;
        continue;
      }
      const auto& image = std::get<CameraFrame>(message);
      sink.takeImage(image, {});
      pixels.emplace_back(image.image.data, image.image.data + image.image.width * image.image.height);
      stamps.push_back(image.stamp);
      ++frames;
    }
    sink.finish();
    CHECK_FALSE(sink.failed());
    CHECK(sink.counters().samples == samples);
    CHECK(sink.counters().images[0] + sink.counters().images[1] == frames);
  }
  std::uint64_t samples = 0;
  std::uint64_t frames = 0;
  std::vector<std::vector<std::uint8_t>> pixels;
  std::vector<Stamp> stamps;
};

TEST_CASE("a recording as MCAP is read back with the same stamps and pixels", "[mcap_sink]") {
  const ScratchFolder folder("mcap_sink");
  const std::string file = folder.file("flight.mcap");
  const Recorded recorded(file);
  LogOptions options;
  options.calibration = kLog;
  options.imu_after_last_image = true;
  {
    const auto log = openLog(file, options);
    std::uint64_t samples = 0;
    std::uint64_t frames = 0;
    SensorMessage message;
    while (log->next(message)) {
      if (std::holds_alternative<ImuSample>(message)) {
        ++samples;
        continue;
      }
      const auto& image = std::get<CameraFrame>(message);
      REQUIRE(frames < recorded.frames);
      CHECK(image.stamp == recorded.stamps[frames]);
      const std::vector<std::uint8_t>& pixels = recorded.pixels[frames];
      CHECK(std::equal(pixels.begin(), pixels.end(), image.image.data));
      ++frames;
    }
    CHECK(samples == recorded.samples);
    CHECK(frames == recorded.frames);
  }
  // A power cut.
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const auto cut = openLog(file, options);
  CHECK(cut->imageCount() > 10);
  CHECK(cut->warnings()[0].find("not closed by its recorder") != std::string::npos);
  CHECK_THROWS_WITH(McapSink(file, cut->calibration()), Catch::Contains("already exists"));
  CHECK_THROWS_WITH(McapSink(folder.file("none/a.mcap"), cut->calibration()),
                    Catch::Contains("cannot be written"));
}

}  // namespace
}  // namespace swiftlet
