// Bad input, one kind a case: a message that names file, line and field, or a counted event and the
// rest of the log delivered.

#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::AslFixture;
using test::contains;
using test::Delivered;
using test::errorOf;
using test::readAll;

void truncate(const fs::path& path, double share) {
  fs::resize_file(path, static_cast<std::uintmax_t>(static_cast<double>(fs::file_size(path)) * share));
}

TEST_CASE("missing images are counted and skipped", "[asl_damage]") {
  const AslFixture log(6);
  fs::remove(log.image(0, 2));
  fs::remove(log.image(1, 4));
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  CHECK(got.frames.size() == 10);
  CHECK(source->counters().missing_images == 2);
  CHECK(anyContains(source->warnings(), std::to_string(log.stamp(2)) + ".png"));
}

TEST_CASE("an image that vanishes during the run is counted and skipped", "[asl_damage]") {
  const AslFixture log(6);
  const auto source = openLog(log.folder.path().string());
  fs::remove(log.image(1, 3));
  CHECK(readAll(*source).frames.size() == 11);
  CHECK(source->counters().missing_images == 1);
}

TEST_CASE("truncated, empty and foreign pictures are counted and skipped", "[asl_damage]") {
  for (const char* extension : {".png", ".jpg"}) {
    INFO(extension);
    const AslFixture log(8, extension);
    truncate(log.image(0, 1), 0.7);
    truncate(log.image(0, 2), 0.02);
    truncate(log.image(1, 3), 0.0);
    test::writeText(log.image(1, 4), "this is no picture at all");
    test::writeBytes(log.image(0, 5), test::encodePng(test::pattern(32, 48, 1), 32, 48));
    const auto source = openLog(log.folder.path().string());
    const Delivered got = readAll(*source);
    CHECK(got.frames.size() == 11);
    CHECK(source->counters().damaged_images == 5);
    CHECK(anyContains(source->warnings(), "damaged or truncated"));
    CHECK(anyContains(source->warnings(), "neither PNG nor JPEG"));
    CHECK(anyContains(source->warnings(), "not the size"));
    for (const CameraFrame& frame : got.frames) CHECK(frame.image.width == 64);
  }
}

TEST_CASE("pictures of another size than the calibration are refused", "[asl_damage]") {
  const AslFixture log(3);
  for (int i = 0; i < 3; ++i)
    test::writeBytes(log.image(0, i), test::encodePng(test::pattern(48, 64, 1), 48, 64));
  const auto source = openLog(log.folder.path().string());
  const InputError error = errorOf([&] { readAll(*source); });
  CHECK(contains(error.message, "48x64 pixels, but the calibration of cam0 is for 64x48"));
  CHECK(error.file == log.image(0, 0).string());
}

TEST_CASE("no image at all is refused", "[asl_damage]") {
  const AslFixture log(3);
  fs::remove_all(log.mav0() / "cam0" / "data");
  fs::remove_all(log.mav0() / "cam1" / "data");
  CHECK(contains(errorOf([&] { openLog(log.folder.path().string()); }).message,
                 "none of the listed images exists"));
}

TEST_CASE("unequal counts are said, every image delivered", "[asl_damage]") {
  const AslFixture log(6);
  std::string csv = test::readText(log.mav0() / "cam1" / "data.csv");
  csv.resize(csv.rfind('\n', csv.size() - 2) + 1);
  test::writeText(log.mav0() / "cam1" / "data.csv", csv);
  const auto source = openLog(log.folder.path().string());
  CHECK(readAll(*source).frames.size() == 11);
  CHECK(anyContains(source->warnings(), "cam0 has 6 images, cam1 has 5"));
  CHECK(source->frameCount() == 6);
}

TEST_CASE("shuffled and repeated rows of the image list are put right", "[asl_damage]") {
  const AslFixture log(4);
  const auto row = [&](int i) {
    return std::to_string(log.stamp(i)) + "," + std::to_string(log.stamp(i)) + ".png\n";
  };
  test::writeText(log.mav0() / "cam0" / "data.csv", row(0) + row(2) + row(1) + row(3) + row(3));
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  CHECK(got.frames.size() == 8);
  for (std::size_t i = 1; i < got.frames.size(); ++i) CHECK(got.frames[i - 1].stamp <= got.frames[i].stamp);
  CHECK(got.pictures[2] == test::pattern(64, 48, 2));
  CHECK(source->counters().out_of_order == 1);
  CHECK(source->counters().repeated_stamps == 1);
}

TEST_CASE("a row with text and a row with NaN in the IMU file", "[asl_damage]") {
  const AslFixture log(6);
  std::string csv = test::readText(log.imuCsv());
  const auto replaceInRow = [&](int row, const std::string& from, const std::string& to) {
    std::size_t at = 0;
    for (int i = 1; i < row; ++i) at = csv.find('\n', at) + 1;
    csv.replace(csv.find(from, at), from.size(), to);
  };
  replaceInRow(20, "-0.02", "gyro");
  replaceInRow(30, "9.8", "nan");
  test::writeText(log.imuCsv(), csv);
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  CHECK(got.samples.size() == 11 + 50 - 2);
  CHECK(source->counters().bad_rows == 1);
  CHECK(source->counters().nan_rows == 1);
  CHECK(anyContains(source->warnings(), log.imuCsv() + ":20: gyro y: `gyro` is not a number"));
  CHECK(anyContains(source->warnings(), log.imuCsv() + ":30: accel z: `nan`"));
}

TEST_CASE("a gap of the IMU passes through untouched", "[asl_damage]") {
  const AslFixture log(40);
  std::string kept;
  std::string csv = test::readText(log.imuCsv());
  int line = 0;
  for (std::size_t at = 0; at < csv.size(); ++line) {
    const std::size_t end = csv.find('\n', at) + 1;
    if (line < 100 || line >= 300) kept += csv.substr(at, end - at);
    at = end;
  }
  test::writeText(log.imuCsv(), kept);
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  CHECK(got.frames.size() == 80);
  std::int64_t widest = 0;
  for (std::size_t i = 1; i < got.samples.size(); ++i) {
    widest = std::max(widest, (got.samples[i].stamp - got.samples[i - 1].stamp).ns);
  }
  CHECK(widest == 201 * AslFixture::kImuPeriod);
}

TEST_CASE("absent and foreign folders and files say what is missing", "[asl_damage]") {
  const AslFixture log(3);
  CHECK(contains(errorOf([&] { openLog((log.folder.path() / "nowhere").string()); }).message,
                 "does not exist"));
  CHECK(contains(errorOf([&] { openLog(log.imuCsv()); }).message, "not a log"));
  const fs::path empty = log.folder.path() / "empty";
  fs::create_directories(empty);
  CHECK(contains(errorOf([&] { openLog(empty.string()); }).message, "not a log"));
  LogOptions wrong;
  wrong.calibration = log.imuCsv();
  CHECK(errorOf([&] { openLog(log.folder.path().string(), wrong); }).file == log.imuCsv());

  fs::rename(log.imuCsv(), log.imuCsv() + ".away");
  CHECK(errorOf([&] { openLog(log.folder.path().string()); }).file == log.imuCsv());
  fs::rename(log.imuCsv() + ".away", log.imuCsv());
  fs::remove(log.mav0() / "imu0" / "sensor.yaml");
  CHECK(errorOf([&] { openLog(log.folder.path().string()); }).file ==
        (log.mav0() / "imu0" / "sensor.yaml").string());
  fs::remove(log.mav0() / "cam0" / "sensor.yaml");
  CHECK(contains(errorOf([&] { openLog(log.folder.path().string()); }).remedy, "with a calibration"));
}

TEST_CASE("clocks that have nothing in common are refused", "[asl_damage]") {
  const AslFixture log(3);
  std::string csv;
  for (int i = 0; i < 50; ++i) csv += std::to_string(5'000'000LL * i) + ",0.01,-0.02,0.03,0.1,0.2,9.8\n";
  test::writeText(log.imuCsv(), csv);
  CHECK(contains(errorOf([&] { openLog(log.folder.path().string()); }).message, "do not overlap"));
}

TEST_CASE("a rate that differs from the calibration is said and corrected", "[asl_damage]") {
  const AslFixture log(4);
  std::string yaml = test::readText(log.mav0() / "imu0" / "sensor.yaml");
  yaml.replace(yaml.find("rate_hz: 200"), 12, "rate_hz: 400");
  test::writeText(log.mav0() / "imu0" / "sensor.yaml", yaml);
  const auto source = openLog(log.folder.path().string());
  CHECK(source->imuNoise().rate_hz == Approx(200));
  CHECK(anyContains(source->warnings(), "runs at 200.0 Hz, its calibration specifies 400 Hz"));
}

}  // namespace
}  // namespace swiftlet
