// Logs and runs as bags of ROS 2, read back: the log's own files and numbers, and again the same bytes.

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/message_coder.hpp"
#include "tests/firmware_host/exported_run.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using test::run;
using test::textOf;

const std::string kLog = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";

std::string lettersOf(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

std::map<std::string, std::uint64_t> countsOf(const std::string& path) {
  const auto bag = openBag(path);
  CHECK(bag->warnings().empty());
  std::map<std::string, std::uint64_t> counts;
  for (const BagTopic& topic : bag->topics()) counts[topic.name] = topic.messages;
  return counts;
}

TEST_CASE("a log's bag holds its image files and its numbers", "[export]") {
  const ScratchFolder folder("log_bag");
  const std::string mcap = folder.file("log.mcap");
  const std::string rosbag2 = folder.file("log");
  REQUIRE(run({"export", kLog, "--mcap", mcap, "--rosbag2", rosbag2}) == kExitDone);
  CHECK(run({"export", kLog, "--rosbag2", rosbag2}) == kExitBadInput);  // never written over
  for (const std::string& path : {mcap, rosbag2}) {
    const auto bag = openBag(path);
    std::ifstream imu_rows(kLog + "/mav0/imu0/data.csv");
    std::string row;
    std::getline(imu_rows, row);  // the header
    std::size_t images = 0;
    std::size_t samples = 0;
    for (const BagEntry& entry : bag->entries()) {
      const BagTopic& topic = bag->topics()[entry.topic];
      const std::span<const std::uint8_t> body = bag->read(entry);
      if (topic.name == "/imu0") {
        rosmsg::Imu imu;
        REQUIRE(decode(body, topic.encoding, imu));
        REQUIRE(std::getline(imu_rows, row));
        std::istringstream columns(row);
        std::vector<std::string> cells;
        for (std::string cell; std::getline(columns, cell, ',');) cells.push_back(cell);
        REQUIRE(cells.size() == 7);
        CHECK(imu.header.stamp.ns == std::stoll(cells[0]));
        CHECK(imu.angular_velocity.x == std::stod(cells[1]));
        CHECK(imu.angular_velocity.z == std::stod(cells[3]));
        CHECK(imu.linear_acceleration.y == std::stod(cells[5]));
        ++samples;
      } else if (topic.name.ends_with("/compressed")) {
        rosmsg::CompressedImage image;
        REQUIRE(decode(body, topic.encoding, image));
        const std::string camera = topic.name.substr(0, topic.name.find('/', 1));
        const std::string file =
            kLog + "/mav0" + camera + "/data/" + std::to_string(image.header.stamp.ns) + ".jpg";
        CHECK(lettersOf(image.data) == textOf(file));
        CHECK(image.format == "jpeg");
        CHECK(image.header.stamp == entry.log_time);
        ++images;
      }
    }
    CHECK(images == 160);
    CHECK(samples > 900);
    CHECK_FALSE(std::getline(imu_rows, row));
  }
}

TEST_CASE("a bag of a bag is the same bag", "[export]") {
  const ScratchFolder folder("bag_bag");
  const std::string first = folder.file("first.mcap");
  REQUIRE(run({"export", kLog, "--mcap", first, "--rosbag2", folder.file("folder")}) == kExitDone);
  for (const std::string& from : {first, folder.file("folder")}) {
    const std::string again = folder.file("again.mcap");
    REQUIRE(run({"export", from, "--calibration", kLog, "--mcap", again}) == kExitDone);
    CHECK(textOf(first) == textOf(again));
  }
  // As pixels too.
  const std::string raw = folder.file("raw.mcap");
  REQUIRE(run({"export", kLog, "--mcap", raw, "--raw-images"}) == kExitDone);
  const std::string again = folder.file("again.mcap");
  REQUIRE(run({"export", raw, "--calibration", kLog, "--mcap", again}) == kExitDone);
  CHECK(textOf(raw) == textOf(again));
  CHECK(countsOf(raw).at("/cam1/image_raw") == 80);
}

TEST_CASE("a run's bag of ROS 2 has what its bag of ROS 1 has", "[export]") {
  const test::ExportedRun exported;
  const std::string mcap = exported.folder.file("run.mcap");
  REQUIRE(run({"export", exported.run, "--mcap", mcap, "--rosbag2", exported.folder.file("rosbag2")}) ==
          kExitDone);
  const auto counts = countsOf(mcap);
  CHECK(counts == countsOf(exported.folder.file("rosbag2")));
  CHECK(counts.size() == 23);
  CHECK(counts.at("/tf_static") == 1);
  CHECK(counts.at("/swiftlet/pose") > 90);
  const auto bag = openBag(mcap);
  for (const BagEntry& entry : bag->entries()) {
    const BagTopic& topic = bag->topics()[entry.topic];
    if (topic.type != rosmsg::Marker::kType) continue;
    rosmsg::Marker marker;
    REQUIRE(decode(bag->read(entry), topic.encoding, marker));
    CHECK(marker.points.size() == marker.colors.size());
    CHECK(marker.header.stamp == entry.log_time);
  }
#ifdef SWIFTLET_NO_RUN_BAG
  return;
#endif
  REQUIRE(run({"export", exported.run, "--bag", exported.folder.file("run.bag")}) == kExitDone);
  CHECK(counts == countsOf(exported.folder.file("run.bag")));
}

TEST_CASE("a run's bag can hold its log, and what does not fit is refused", "[export]") {
  const ScratchFolder folder("run_images");
  const std::string out = folder.file("run");
  REQUIRE(run({"replay", kLog, "--out", out}) != kExitBadInput);
  const std::string mcap = folder.file("run.mcap");
  REQUIRE(run({"export", out, "--mcap", mcap, "--images"}) == kExitDone);
  const auto counts = countsOf(mcap);
  CHECK(counts.at("/cam0/image_raw/compressed") == 80);
  CHECK(counts.at("/swiftlet/pose") > 50);
  CHECK(counts.at("/tf_static") == 1);
  CHECK(run({"export", kLog, "--tum", folder.file("tum")}) == kExitBadInput);
  CHECK(run({"export", mcap, "--mcap", folder.file("x.mcap")}) == kExitBadInput);  // no calibration
  CHECK_FALSE(fs::exists(folder.file("x.mcap")));
  CHECK_FALSE(fs::exists(folder.file("x.mcap.part")));
}

}  // namespace
}  // namespace swiftlet
