// A log in an archive gives what its folder gives, in whatever format and order; damage is named.

#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/depth_images.hpp"
#include "drivers/recorded/label_images.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::AslFixture;
using test::contains;
using test::Delivered;
using test::errorOf;
using test::kKalibrIllustration;
using test::kKalibrImu;
using test::readAll;

enum class Order { kSorted, kReversed, kMixed };

std::vector<fs::path> filesOf(const fs::path& folder, Order order) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  if (order == Order::kReversed) std::ranges::reverse(files);
  if (order == Order::kMixed) {
    Random random(5, 0);
    for (std::size_t i = files.size(); i > 1; --i)
      std::swap(files[i - 1], files[random.below(static_cast<std::uint32_t>(i))]);
  }
  return files;
}

/// `around`: put before each name, "MH_01/" or "./".
fs::path pack(const AslFixture& log, const std::string& name, int (*format)(archive*),
              int (*filter)(archive*), const std::string& around, Order order) {
  const fs::path path = log.folder.path() / name;
  archive* handle = archive_write_new();
  REQUIRE(format(handle) == ARCHIVE_OK);
  if (filter != nullptr) REQUIRE(filter(handle) == ARCHIVE_OK);
  REQUIRE(archive_write_open_filename(handle, path.c_str()) == ARCHIVE_OK);
  for (const fs::path& file : filesOf(log.mav0(), order)) {
    const std::string bytes = test::readText(file);
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, (around + "mav0/" + fs::relative(file, log.mav0()).string()).c_str());
    archive_entry_set_size(entry, static_cast<la_int64_t>(bytes.size()));
    archive_entry_set_filetype(entry, AE_IFREG);
    archive_entry_set_perm(entry, 0644);
    REQUIRE(archive_write_header(handle, entry) == ARCHIVE_OK);
    REQUIRE(archive_write_data(handle, bytes.data(), bytes.size()) == static_cast<la_ssize_t>(bytes.size()));
    archive_entry_free(entry);
  }
  REQUIRE(archive_write_close(handle) == ARCHIVE_OK);
  archive_write_free(handle);
  return path;
}

bool same(const Delivered& a, const Delivered& b) {
  const auto stamps = [](const Delivered& delivered) {
    std::vector<std::int64_t> list;
    for (const ImuSample& sample : delivered.samples) list.push_back(sample.stamp.ns);
    for (const CameraFrame& frame : delivered.frames) list.push_back(frame.stamp.ns);
    return list;
  };
  return a.order == b.order && a.pictures == b.pictures && stamps(a) == stamps(b);
}

TEST_CASE("an archive gives what its folder gives", "[archive]") {
  AslFixture log(12);
  // Ground truth, depth and labels are read in it too.
  const std::string rows =
      std::to_string(log.stamp(0)) + ",1,2,3,1,0,0,0\n" + std::to_string(log.stamp(9)) + ",2,2,3,1,0,0,0\n";
  fs::create_directories(log.mav0() / "state_groundtruth_estimate0");
  test::writeText(log.mav0() / "state_groundtruth_estimate0" / "data.csv", rows);
  fs::create_directories(log.mav0() / "labels0" / "data");
  test::writeText(log.mav0() / "labels0" / "data.csv", std::to_string(log.stamp(3)) + ",a.png\n");
  test::writeBytes(log.mav0() / "labels0" / "data" / "a.png",
                   test::encodePng(test::pattern(64, 48, 9), 64, 48));
  const Delivered expected = readAll(*openLog(log.folder.path().string()));
  REQUIRE(expected.pictures.size() == 24);
  const auto check = [&](const fs::path& path) {
    INFO(path.string());
    const auto source = openLog(path.string());
    CHECK(same(readAll(*source), expected));
    CHECK(source->groundTruth().size() == 2);
    CHECK(contains(source->groundTruthName(), path.string() + "/"));
    LogWarnings warnings;
    LabelImages labels(path.string(), {64, 48}, warnings);
    CHECK(labels.listed() == 1);
    CHECK(labels.at({log.stamp(3)}).row(5)[7] == test::pattern(64, 48, 9)[5 * 64 + 7]);
  };
  for (const Order order : {Order::kSorted, Order::kReversed, Order::kMixed}) {
    check(pack(log, "a.zip", archive_write_set_format_zip, nullptr, "", order));
    check(pack(log, "b.tar", archive_write_set_format_pax_restricted, nullptr, "./", order));
    check(pack(log, "c.tar.gz", archive_write_set_format_ustar, archive_write_add_filter_gzip, "MH_01/",
               order));
    check(pack(log, "d.tar.zst", archive_write_set_format_gnutar, archive_write_add_filter_zstd, "", order));
    check(pack(log, "e.7z", archive_write_set_format_7zip, nullptr, "data/MH_01/", order));
  }
  // By another program.
  const std::string file = (log.folder.path() / "f.tar.xz").string();
  REQUIRE(std::system(("tar -cJf " + file + " -C " + log.folder.path().string() + " mav0").c_str()) == 0);
  check(file);
}

TEST_CASE("Kalibr's files in an archive, as TUM-VI has them", "[archive]") {
  const AslFixture log(3);
  for (const char* sensor : {"cam0", "cam1", "imu0"}) fs::remove(log.mav0() / sensor / "sensor.yaml");
  test::writeText(log.mav0() / "dso" / "chain.yaml", kKalibrIllustration);
  test::writeText(log.mav0() / "dso" / "imu.yaml", kKalibrImu);
  const fs::path path = pack(log, "a.zip", archive_write_set_format_zip, nullptr, "", Order::kSorted);
  const auto source = openLog(path.string());
  CHECK(source->calibration().form == "Kalibr");
  CHECK(readAll(*source).frames.size() == 3);
}

TEST_CASE("what is no log or several is named", "[archive]") {
  const AslFixture log(2);
  const fs::path path = log.folder.path() / "two.tar";
  REQUIRE(
      std::system(("cd " + log.folder.path().string() +
                   " && mkdir -p a b && cp -r mav0 a && cp -r mav0 b && tar -cf " + path.string() + " a b")
                      .c_str()) == 0);
  CHECK(contains(errorOf([&] { (void)openLog(path.string()); }).what(), "holds 2 logs: a/mav0"));
  REQUIRE(std::system(
              ("tar -cf " + path.string() + " -C " + log.mav0().string() + " cam0/data.csv").c_str()) == 0);
  CHECK(contains(errorOf([&] { (void)openLog(path.string()); }).what(),
                 "two.tar/cam0/sensor.yaml: does not exist"));
}

TEST_CASE("an archive that is cut or flipped is refused, or gives no other content", "[archive]") {
  const AslFixture log(3);
  const Delivered expected = readAll(*openLog(log.folder.path().string()));
  const std::vector<fs::path> paths = {
      pack(log, "a.zip", archive_write_set_format_zip, nullptr, "", Order::kSorted),
      pack(log, "c.tar.gz", archive_write_set_format_ustar, archive_write_add_filter_gzip, "",
           Order::kSorted)};
  for (const fs::path& path : paths) {
    const std::string whole = test::readText(path);
    int refused = 0;
    Random random(8, 0);
    for (int trial = 0; trial < 60; ++trial) {
      std::string bytes = whole;
      const std::size_t at = random.below(static_cast<std::uint32_t>(bytes.size()));
      if (trial % 2 == 0) {
        bytes.resize(at);
      } else {
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << random.below(8)));
      }
      test::writeText(path, bytes);
      try {
        const auto source = openLog(path.string());
        const Delivered got = readAll(*source);
        // A picture may be missing, never another.
        for (const auto& picture : got.pictures) {
          CHECK(std::ranges::find(expected.pictures, picture) != expected.pictures.end());
        }
      } catch (const InputError& error) {
        CHECK(contains(error.what(), path.filename().string()));
        ++refused;
      }
    }
    CHECK(refused > 10);
  }
}

TEST_CASE("pictures that are numbered take the calibration's rate, and it is said", "[asl]") {
  AslFixture log(4);
  for (int camera = 0; camera < 2; ++camera) {
    for (int i = 0; i < 4; ++i) {
      fs::rename(log.image(camera, i),
                 log.image(camera, i).parent_path() / ("frame_00000" + std::to_string(i + 1) + ".png"));
    }
    fs::remove(log.mav0() / ("cam" + std::to_string(camera)) / "data.csv");
  }
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  REQUIRE(got.frames.size() == 8);
  const std::int64_t first = got.samples.front().stamp.ns;
  CHECK(got.frames[0].stamp.ns == first);
  CHECK(got.frames[7].stamp.ns == first + 3 * AslFixture::kImagePeriod);
  CHECK(test::anyContains(source->warnings(), "20 Hz from the first IMU sample on"));
  // Without a rate there is nothing to go by.
  for (const char* camera : {"cam0", "cam1"}) {
    const fs::path yaml = log.mav0() / camera / "sensor.yaml";
    std::string text = test::readText(yaml);
    const std::size_t at = text.find("rate_hz");
    text.erase(at, text.find('\n', at) - at);
    test::writeText(yaml, text);
  }
  CHECK(contains(errorOf([&] { (void)openLog(log.folder.path().string()); }).what(),
                 "names like `frame_000001.png` are not stamps"));
}

}  // namespace
}  // namespace swiftlet
