// Logs out of ROS 2's bags: what they give beside the folder of the same flight.

#include <algorithm>
#include <functional>
#include <optional>

#include "drivers/bag/message_bag.hpp"
#include "drivers/recorded/join_imu.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::AslFixture;
using test::contains;
using test::Delivered;
using test::errorOf;

rosmsg::Imu imuAt(std::int64_t t, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel) {
  rosmsg::Imu imu;
  imu.header.stamp.ns = t;
  imu.angular_velocity = {gyro.x(), gyro.y(), gyro.z()};
  imu.linear_acceleration = {accel.x(), accel.y(), accel.z()};
  return imu;
}

rosmsg::Image imageOf(std::int64_t t, const std::vector<std::uint8_t>& pixels, int width, int height) {
  rosmsg::Image image;
  image.header.stamp.ns = t;
  image.width = static_cast<std::uint32_t>(width);
  image.height = static_cast<std::uint32_t>(height);
  image.step = image.width;
  image.encoding = "mono8";
  image.data = pixels;
  return image;
}

/// The fixture's flight in a bag.
struct BagFixture {
  [[nodiscard]] std::string path() const { return (asl.folder.path() / "flight").string(); }
  [[nodiscard]] LogOptions options() const {
    LogOptions options;
    options.calibration = asl.mav0().string();
    return options;
  }
  void write(const std::function<void(MessageBag&)>& fill, bool mcap = true) const {
    fs::remove_all(path());
    MessageBag bag(mcap ? makeMcapWriter(path(), McapPacking::kZstd) : makeRosbag2Writer(path(), "flight"));
    fill(bag);
    bag.finish();
  }
  void putImu(MessageBag& bag, const std::string& topic = "/imu0") const {
    for (std::int64_t t = asl.stamp(-1); t <= asl.stamp(6); t += AslFixture::kImuPeriod) {
      bag.write(topic, Stamp{t}, imuAt(t, {0.01, -0.02, 0.03}, {0.1, 0.2, 9.8}));
    }
  }
  void putImages(MessageBag& bag, bool files, const std::string& before = "/cam") const {
    for (int i = 0; i < asl.frames; ++i) {
      for (int c = 1; c >= 0; --c) {
        const std::vector<std::uint8_t> pixels = test::pattern(64, 48, 2 * i + c);
        const std::string topic = before + std::to_string(c) + "/image_raw";
        if (!files) {
          bag.write(topic, Stamp{asl.stamp(i)}, imageOf(asl.stamp(i), pixels, 64, 48));
          continue;
        }
        const std::vector<std::uint8_t> png = test::encodePng(pixels, 64, 48);
        rosmsg::CompressedImage image;
        image.header.stamp.ns = asl.stamp(i);
        image.format = "png";
        image.data = png;
        bag.write(topic + "/compressed", Stamp{asl.stamp(i)}, image);
      }
    }
  }
  AslFixture asl{6};
};

void checkSame(const Delivered& a, const Delivered& b) {
  CHECK(a.order == b.order);
  CHECK(a.pictures == b.pictures);
  REQUIRE(a.samples.size() == b.samples.size());
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    CHECK(a.samples[i].stamp == b.samples[i].stamp);
    CHECK(a.samples[i].gyro == b.samples[i].gyro);
    CHECK(a.samples[i].accel == b.samples[i].accel);
  }
}

TEST_CASE("a bag of ROS 2 gives what the folder of the same flight gives", "[bag_log]") {
  const BagFixture fixture;
  for (const bool mcap : {true, false}) {
    for (const bool files : {true, false}) {
      fixture.write(
          [&](MessageBag& bag) {
            fixture.putImages(bag, files);
            fixture.putImu(bag);
          },
          mcap);
      const auto from_bag = openLog(fixture.path(), fixture.options());
      const auto from_folder = openLog(fixture.asl.folder.path().string());
      CHECK(from_bag->imageCount() == 12);
      checkSame(test::readAll(*from_bag), test::readAll(*from_folder));
      CHECK(from_bag->warnings().empty());
    }
  }
}

TEST_CASE("a gyroscope and an accelerometer on two topics are one IMU", "[bag_log]") {
  const BagFixture fixture;
  // As a RealSense sends them: other rates, other stamps, the unused half zero; a line in time for the
  // oracle.
  const auto accelAt = [&](std::int64_t t) {
    const double s = static_cast<double>(t - fixture.asl.stamp(0)) * 1e-9;
    return Eigen::Vector3d(0.1 + s, 0.2 - 2 * s, 9.8);
  };
  fixture.write([&](MessageBag& bag) {
    fixture.putImages(bag, false);
    for (std::int64_t t = fixture.asl.stamp(-1); t <= fixture.asl.stamp(6); t += AslFixture::kImuPeriod) {
      bag.write("/camera/gyro/sample", Stamp{t}, imuAt(t, {0.01, -0.02, 0.03}, {0, 0, 0}));
    }
    for (std::int64_t t = fixture.asl.stamp(-1) + 1'234'567; t <= fixture.asl.stamp(6); t += 10'000'000) {
      bag.write("/camera/accel/sample", Stamp{t}, imuAt(t, {0, 0, 0}, accelAt(t)));
    }
  });
  const auto log = openLog(fixture.path(), fixture.options());
  CHECK(anyContains(log->warnings(), "/camera/accel/sample"));
  const Delivered all = test::readAll(*log);
  REQUIRE(all.samples.size() > 50);
  for (const ImuSample& sample : all.samples) {
    CHECK(sample.gyro == Eigen::Vector3d(0.01, -0.02, 0.03));
    CHECK((sample.accel - accelAt(sample.stamp.ns)).norm() < 1e-9);
  }
  fixture.write([&](MessageBag& bag) {
    fixture.putImages(bag, false);
    for (std::int64_t t = fixture.asl.stamp(-1); t <= fixture.asl.stamp(6); t += AslFixture::kImuPeriod) {
      bag.write("/camera/gyro/sample", Stamp{t}, imuAt(t, {0.01, -0.02, 0.03}, {0, 0, 0}));
    }
  });
  CHECK(contains(errorOf([&] { openLog(fixture.path(), fixture.options()); }).remedy, "accelerometer"));
}

TEST_CASE("an accelerometer's gap leaves the gyroscope's samples out", "[bag_log]") {
  const auto at = [](std::int64_t ms, double value) {
    ImuSample sample;
    sample.stamp.ns = ms * 1'000'000;
    sample.accel = {value, 0, 0};
    return sample;
  };
  std::uint64_t left_out = 0;
  const std::vector<ImuSample> joined =
      joinImu({at(5, 0), at(10, 0), at(15, 0), at(30, 0), at(120, 0), at(140, 0)},
              {at(10, 1), at(20, 2), at(30, 3), at(135, 4), at(145, 5)}, left_out);
  REQUIRE(joined.size() == 4);
  CHECK(left_out == 2);
  CHECK(joined[0].accel.x() == 1);
  CHECK(joined[1].accel.x() == Approx(1.5));
  CHECK(joined[2].accel.x() == 3);
  CHECK(joined[3].accel.x() == Approx(4.5));
}

TEST_CASE("of many image topics those with the calibration's size are taken", "[bag_log]") {
  const BagFixture fixture;
  fixture.write([&](MessageBag& bag) {
    const std::vector<std::uint8_t> large = test::pattern(128, 96, 1);
    bag.write("/a/color/image_raw", Stamp{fixture.asl.stamp(0)},
              imageOf(fixture.asl.stamp(0), large, 128, 96));
    const std::vector<std::uint8_t> depth = test::pattern(64, 48, 1);
    bag.write("/a/depth/image_raw", Stamp{fixture.asl.stamp(0)},
              imageOf(fixture.asl.stamp(0), depth, 64, 48));
    fixture.putImages(bag, false, "/camera/infra");
    fixture.putImu(bag);
  });
  const auto log = openLog(fixture.path(), fixture.options());
  CHECK(log->imageCount() == 12);
  CHECK(anyContains(log->warnings(), "/camera/infra0/image_raw and /camera/infra1/image_raw"));
}

TEST_CASE("poses on a topic of true poses are the truth", "[bag_log]") {
  const BagFixture fixture;
  fixture.write([&](MessageBag& bag) {
    fixture.putImages(bag, false);
    fixture.putImu(bag);
    for (int i = 5; i >= 0; --i) {
      rosmsg::PoseStamped pose;
      pose.header.stamp.ns = fixture.asl.stamp(i);
      pose.pose.position = {1.0 * i, 2, 3};
      bag.write("/truth/pose", Stamp{fixture.asl.stamp(i)}, pose);
    }
    rosmsg::PoseStamped broken;
    broken.pose.orientation.w = 3;
    bag.write("/truth/pose", Stamp{fixture.asl.stamp(3)}, broken);
  });
  const auto log = openLog(fixture.path(), fixture.options());
  LogWarnings warnings;
  const Trajectory truth = log->groundTruth(warnings);
  CHECK(anyContains(warnings.lines(), "/truth/pose: the message received at"));
  CHECK(anyContains(warnings.lines(), "is not a pose, skipped"));
  REQUIRE(truth.size() == 6);
  CHECK(truth[4].stamp.ns == fixture.asl.stamp(4));
  CHECK(truth[4].T_world_body.translation == Eigen::Vector3d(4, 2, 3));
  CHECK(contains(log->groundTruthName(), "/truth/pose"));
}

TEST_CASE("a stamp beyond the range of stamps is refused with file, topic and stamp", "[bag_log]") {
  const bool mcap = GENERATE(true, false);
  const BagFixture fixture;
  fixture.write(
      [&](MessageBag& bag) {
        fixture.putImages(bag, false);
        fixture.putImu(bag);
        bag.write("/imu0", Stamp{5'000'000'000'000'000'000}, imuAt(fixture.asl.stamp(3), {}, {0, 0, 9.8}));
      },
      mcap);
  const InputError error = errorOf([&] { openLog(fixture.path(), fixture.options()); });
  CHECK(contains(error.file, fixture.path()));
  CHECK(contains(error.what(), "/imu0: "));
  CHECK(contains(error.message, "5000000000000000000 ns"));
}

TEST_CASE("bags of ROS 2 with less than a log needs are refused", "[bag_log]") {
  const BagFixture fixture;
  fixture.write([&](MessageBag& bag) { fixture.putImu(bag); });
  CHECK(contains(errorOf([&] { openLog(fixture.path()); }).message, "no calibration"));
  CHECK(contains(errorOf([&] { openLog(fixture.path(), fixture.options()); }).message,
                 "no topic of type sensor_msgs/Image"));
  fixture.write([&](MessageBag& bag) { fixture.putImages(bag, true); });
  CHECK(contains(errorOf([&] { openLog(fixture.path(), fixture.options()); }).message, "sensor_msgs/Imu"));
}

}  // namespace
}  // namespace swiftlet
