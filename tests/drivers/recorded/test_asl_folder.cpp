// A whole EuRoC folder: order, pictures, truth, relatives.

#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::AslFixture;
using test::Delivered;
using test::errorOf;
using test::kKalibrIllustration;
using test::kKalibrImu;
using test::readAll;

TEST_CASE("everything comes in the order of time, samples first, camera 0 before 1", "[asl]") {
  const AslFixture log(5);
  for (const std::string& path : {log.folder.path().string(), log.mav0().string()}) {
    const auto source = openLog(path);
    CHECK(source->imageCount() == 10);
    CHECK(source->frameCount() == 5);
    const Delivered got = readAll(*source);
    REQUIRE(got.frames.size() == 10);
    // 50 ms before the first image, then up to the last image and no further.
    CHECK(got.samples.size() == 11 + 4 * 10);
    std::string expected;
    for (int i = 0; i < 11; ++i) expected += "i ";
    expected += "c0 c1 ";
    for (int f = 1; f < 5; ++f) expected += "i i i i i i i i i i c0 c1 ";
    std::string order;
    for (const std::string& item : got.order) order += item + " ";
    CHECK(order == expected);
    for (std::size_t i = 0; i < 10; ++i) {
      const CameraFrame& frame = got.frames[i];
      CHECK(frame.stamp.ns == log.stamp(static_cast<int>(i / 2)));
      CHECK(frame.arrival == frame.stamp);
      CHECK(frame.clock == Clock::kLog);
      CHECK(frame.camera == i % 2);
      CHECK(frame.sequence == i / 2);
      CHECK(got.pictures[i] == test::pattern(64, 48, static_cast<int>(i)));
    }
    CHECK(source->counters().imu_samples == got.samples.size());
    CHECK(source->counters().images[0] == 5);
    CHECK(source->counters().images[1] == 5);
    CHECK(source->warnings().empty());
    CHECK(source->groundTruth().empty());
  }
}

TEST_CASE("a log goes on from any moment, forth and back", "[asl]") {
  const AslFixture log(5);
  const auto source = openLog(log.folder.path().string());
  for (const int first : {3, 1, 4, 0}) {
    CAPTURE(first);
    source->seek({log.stamp(first)});
    const Delivered got = readAll(*source);
    REQUIRE(got.frames.size() == static_cast<std::size_t>(2 * (5 - first)));
    CHECK(got.frames[0].stamp.ns == log.stamp(first));
    CHECK(got.pictures[0] == test::pattern(64, 48, 2 * first));
    // The sample of the same moment comes before the image.
    CHECK(got.samples.size() == static_cast<std::size_t>(1 + 10 * (4 - first)));
  }
  source->seek({log.stamp(4) + 1});
  SensorMessage message;
  CHECK_FALSE(source->next(message));
}

TEST_CASE("samples after the last image come on request", "[asl]") {
  const AslFixture log(5);
  LogOptions options;
  options.imu_after_last_image = true;
  CHECK(readAll(*openLog(log.folder.path().string(), options)).samples.size() == 11 + 5 * 10);
}

TEST_CASE("JPEG files and names that are not the stamp are read", "[asl]") {
  AslFixture log(3, ".jpg");
  fs::rename(log.image(0, 1), log.mav0() / "cam0" / "data" / "second picture.jpeg");
  test::writeText(log.mav0() / "cam0" / "data.csv",
                  "#timestamp [ns],filename\r\n" + std::to_string(log.stamp(0)) + ", " +
                      std::to_string(log.stamp(0)) + ".jpg\r\n" + std::to_string(log.stamp(1)) +
                      ",second picture.jpeg\r\n" + std::to_string(log.stamp(2)) + "\r\n");
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  REQUIRE(got.frames.size() == 6);
  CHECK(source->warnings().empty());
  const int worst = test::largestDifference(test::pattern(64, 48, 2), got.pictures[2]);
  CHECK(worst > 0);
  CHECK(worst < 160);  // the pattern wraps around, where JPEG rings
}

TEST_CASE("a picture stays valid while further ones of its camera are fetched", "[asl]") {
  const AslFixture log(8);
  const auto source = openLog(log.folder.path().string());
  std::vector<CameraFrame> held;
  SensorMessage message;
  while (source->next(message)) {
    const auto* frame = std::get_if<CameraFrame>(&message);
    if (frame == nullptr || frame->camera != 0) continue;
    held.push_back(*frame);
    const std::size_t oldest =
        held.size() >= LogSource::kImageSlots ? held.size() - LogSource::kImageSlots : 0;
    for (std::size_t k = oldest; k < held.size(); ++k) {
      CHECK(held[k].image.row(0)[0] == test::pattern(64, 48, 2 * static_cast<int>(k))[0]);
    }
  }
  CHECK(held.size() == 8);
}

TEST_CASE("one camera: no cam1 folder, or asked for", "[asl]") {
  const AslFixture log(3);
  LogOptions mono;
  mono.mono = true;
  CHECK(readAll(*openLog(log.folder.path().string(), mono)).frames.size() == 3);
  fs::remove_all(log.mav0() / "cam1");
  const auto source = openLog(log.folder.path().string());
  CHECK(source->rig().camera_count == 1);
  CHECK(readAll(*source).frames.size() == 3);
}

TEST_CASE("a folder without data.csv is read by its image names", "[asl]") {
  const AslFixture log(3);
  fs::remove(log.mav0() / "cam0" / "data.csv");
  const auto source = openLog(log.folder.path().string());
  CHECK(readAll(*source).frames.size() == 6);
  CHECK(anyContains(source->warnings(), "stamps are taken from the image names"));
}

TEST_CASE("Kalibr calibration beside the data, or given", "[asl]") {
  const AslFixture log(3);
  LogOptions options;
  options.calibration = (log.folder.path() / "kalibr").string();
  test::writeText(log.folder.path() / "kalibr" / "chain.yaml", kKalibrIllustration);
  test::writeText(log.folder.path() / "kalibr" / "imu.yaml", kKalibrImu);
  const auto given = openLog(log.folder.path().string(), options);
  CHECK(given->rig().camera[0].kind() == CameraKind::kEquidistant);
  CHECK(given->rig().camera_to_imu_shift.ns == 2'000'000);
  CHECK(given->rig().camera_count == 1);

  for (const char* file : {"cam0/sensor.yaml", "cam1/sensor.yaml", "imu0/sensor.yaml"})
    fs::remove(log.mav0() / file);
  fs::rename(log.folder.path() / "kalibr", log.folder.path() / "dso");
  CHECK(readAll(*openLog(log.folder.path().string())).frames.size() == 3);
}

std::string truthRow(std::int64_t ns, double x) {
  return std::to_string(ns) + "," + std::to_string(x) + ",2,3,1,0,0,0,0.1,0.2,0.3,0,0,0,0,0,0\n";
}

TEST_CASE("the truth that covers more of the images is taken, OpenVINS' on a tie", "[asl]") {
  const AslFixture log(5);
  const fs::path ours = log.mav0() / "state_groundtruth_estimate0" / "data.csv";
  const fs::path theirs = log.mav0() / "state_groundtruth_openvins" / "data.csv";
  test::writeText(ours, "#h\n" + truthRow(log.stamp(1), 1) + truthRow(log.stamp(9), 1));
  CHECK(openLog(log.folder.path().string())->groundTruthName() == ours.string());
  test::writeText(theirs, "#h\n" + truthRow(log.stamp(0), 2) + truthRow(log.stamp(4), 2));
  const auto source = openLog(log.folder.path().string());
  CHECK(source->groundTruthName() == theirs.string());
  const Trajectory truth = source->groundTruth();
  REQUIRE(truth.size() == 2);
  CHECK(truth[1].T_world_body.translation == Eigen::Vector3d(2, 2, 3));
  test::writeText(theirs, "#h\n" + truthRow(log.stamp(1), 2) + truthRow(log.stamp(4), 2));
  CHECK(openLog(log.folder.path().string())->groundTruthName() == theirs.string());
  test::writeText(theirs, "#h\n" + truthRow(log.stamp(2), 2) + truthRow(log.stamp(9), 2));
  CHECK(openLog(log.folder.path().string())->groundTruthName() == ours.string());
  test::writeText(theirs, "#h\nnonsense\n");
  const auto damaged = openLog(log.folder.path().string());
  CHECK(damaged->groundTruthName() == ours.string());
  CHECK(anyContains(damaged->warnings(), "truth omitted"));
}

TEST_CASE("an IMU turned and moved in the body: samples, rig and truth agree", "[asl]") {
  const AslFixture log(3);
  test::writeText(log.mav0() / "state_groundtruth_estimate0" / "data.csv",
                  "#h\n" + truthRow(log.stamp(0), 1) + truthRow(log.stamp(2), 1));
  const std::string yaml = test::readText(log.mav0() / "imu0" / "sensor.yaml");
  // x of the IMU is y of the body, y of the IMU is minus x of the body.
  test::writeText(log.mav0() / "imu0" / "sensor.yaml",
                  yaml + "T_BS:\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n");
  const auto source = openLog(log.folder.path().string());
  const Delivered got = readAll(*source);
  CHECK(got.samples[0].gyro.isApprox(Eigen::Vector3d(0.02, 0.01, 0.03)));
  CHECK(got.samples[0].accel.isApprox(Eigen::Vector3d(-0.2, 0.1, 9.8)));
  CHECK(source->rig().T_body_cam[0].translation.isApprox(Eigen::Vector3d(-0.1, -0.2, -0.3)));
  // The truth is the file's body; the estimator's body is the IMU, 0.1 0.2 0.3 from it.
  CHECK(source->groundTruth()[0].T_world_body.translation.isApprox(Eigen::Vector3d(1.1, 2.2, 3.3)));
}

}  // namespace
}  // namespace swiftlet
