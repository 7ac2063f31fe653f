// Small bags written with rosbag-storage: read back, and compared with ours byte for byte.

#include <rosbag/bag.h>

#include <cmath>
#include <cstring>

#include "drivers/bag/bag_writer.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/drivers/recorded/ros_bodies.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {

/// A message of any type, given by its serialized body.
struct RawMessage {
  std::vector<std::uint8_t> body;
};
/// What the traits below answer; a bag asks for them when it first sees a topic.
inline std::string raw_type;

}  // namespace swiftlet::test

namespace ros {
namespace message_traits {
template <>
struct MD5Sum<swiftlet::test::RawMessage> {
  static const char* value(const swiftlet::test::RawMessage&) { return "0123456789abcdef0123456789abcdef"; }
};
template <>
struct DataType<swiftlet::test::RawMessage> {
  static const char* value(const swiftlet::test::RawMessage&) { return swiftlet::test::raw_type.c_str(); }
};
template <>
struct Definition<swiftlet::test::RawMessage> {
  static const char* value(const swiftlet::test::RawMessage&) { return ""; }
};
}  // namespace message_traits
namespace serialization {
template <>
struct Serializer<swiftlet::test::RawMessage> {
  template <typename Stream>
  static void write(Stream& stream, const swiftlet::test::RawMessage& message) {
    std::memcpy(stream.advance(static_cast<std::uint32_t>(message.body.size())), message.body.data(),
                message.body.size());
  }
  static std::uint32_t serializedLength(const swiftlet::test::RawMessage& message) {
    return static_cast<std::uint32_t>(message.body.size());
  }
};
}  // namespace serialization
}  // namespace ros

namespace swiftlet {
namespace {

using test::AslFixture;
using test::contains;
using test::Delivered;
using test::errorOf;

/// The fixture's log as a bag; received late and out of order, as recorders do.
class BagFixture {
 public:
  explicit BagFixture(rosbag::CompressionType compression = rosbag::compression::Uncompressed) : asl(6) {
    bag_.open(path(), rosbag::bagmode::Write);
    bag_.setCompression(compression);
  }
  [[nodiscard]] std::string path() const { return (asl.folder.path() / "flight.bag").string(); }
  void put(const std::string& topic, const std::string& type, std::int64_t received,
           std::vector<std::uint8_t> body) {
    test::raw_type = type;
    ros::Time time;
    time.fromNSec(static_cast<std::uint64_t>(received));
    bag_.write(topic, time, test::RawMessage{std::move(body)});
  }
  void putAll(bool compressed_pictures) {
    constexpr std::int64_t kImageDelay = 30'000'000;
    constexpr std::int64_t kImuDelay = 1'000'000;
    for (std::int64_t t = asl.stamp(-1); t <= asl.stamp(6); t += AslFixture::kImuPeriod) {
      put("/imu0", "sensor_msgs/Imu", t + kImuDelay,
          test::imuBody({t}, {0.01, -0.02, 0.03}, {0.1, 0.2, 9.8}));
    }
    for (int i = 0; i < asl.frames; ++i) {
      for (int c = 1; c >= 0; --c) {
        const std::vector<std::uint8_t> pixels = test::pattern(64, 48, 2 * i + c);
        const std::string topic = "/cam" + std::to_string(c) + "/image_raw";
        const Stamp stamp{asl.stamp(i)};
        if (compressed_pictures) {
          put(topic + "/compressed", "sensor_msgs/CompressedImage", stamp.ns + kImageDelay,
              test::compressedBody(stamp, test::encodePng(pixels, 64, 48)));
        } else {
          put(topic, "sensor_msgs/Image", stamp.ns + kImageDelay,
              test::imageBody(stamp, 64, 48, "mono8", 64, pixels));
        }
      }
    }
    put("/tf", "tf2_msgs/TFMessage", asl.stamp(0), {0, 0, 0, 0});
  }
  void close() { bag_.close(); }
  [[nodiscard]] LogOptions options() const {
    LogOptions options;
    options.calibration = asl.mav0().string();
    return options;
  }
  AslFixture asl;

 private:
  rosbag::Bag bag_;
};

TEST_CASE("a bag gives what the folder of the same flight gives", "[ros_bag]") {
  for (const rosbag::CompressionType compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    for (const bool compressed_pictures : {false, true}) {
      BagFixture bag(compression);
      bag.putAll(compressed_pictures);
      bag.close();
      const auto from_bag = openLog(bag.path(), bag.options());
      const auto from_folder = openLog(bag.asl.folder.path().string());
      CHECK(from_bag->imageCount() == 12);
      CHECK(from_bag->frameCount() == 6);
      const Delivered a = test::readAll(*from_bag);
      const Delivered b = test::readAll(*from_folder);
      CHECK(a.order == b.order);
      CHECK(a.pictures == b.pictures);
      REQUIRE(a.samples.size() == b.samples.size());
      for (std::size_t i = 0; i < a.samples.size(); ++i) {
        CHECK(a.samples[i].stamp == b.samples[i].stamp);
        CHECK(a.samples[i].accel == b.samples[i].accel);
      }
    }
  }
}

TEST_CASE("bags with less than a log needs are refused", "[ros_bag]") {
  BagFixture bag;
  bag.putAll(false);
  bag.close();
  CHECK(contains(errorOf([&] { openLog(bag.path()); }).message, "no calibration"));
  BagFixture blind;
  blind.put("/imu0", "sensor_msgs/Imu", blind.asl.stamp(0),
            test::imuBody({blind.asl.stamp(0)}, {0, 0, 0}, {0, 0, 9.8}));
  blind.close();
  CHECK(contains(errorOf([&] { openLog(blind.path(), blind.options()); }).message,
                 "no topic of type sensor_msgs/Image"));
  BagFixture still;
  still.put("/cam0", "sensor_msgs/Image", still.asl.stamp(0),
            test::imageBody({still.asl.stamp(0)}, 64, 48, "mono8", 64, test::pattern(64, 48, 0)));
  still.close();
  CHECK(contains(errorOf([&] { openLog(still.path(), still.options()); }).message, "sensor_msgs/Imu"));
}

TEST_CASE("a header's stamp beyond the range of stamps is refused with topic and stamp", "[ros_bag]") {
  BagFixture fixture;
  fixture.putAll(false);
  const Stamp late{4'200'000'000'000'000'000};
  fixture.put("/imu0", "sensor_msgs/Imu", fixture.asl.stamp(3), test::imuBody(late, {}, {0, 0, 9.8}));
  fixture.close();
  const InputError error = errorOf([&] { openLog(fixture.path(), fixture.options()); });
  CHECK(error.file == fixture.path() + " /imu0");
  CHECK(contains(error.message, "4200000000000000000 ns"));
}

TEST_CASE("the writer's bytes are those of rosbag", "[ros_bag]") {
  const AslFixture asl(1);
  const std::string theirs = (asl.folder.path() / "theirs.bag").string();
  const std::string ours = (asl.folder.path() / "ours.bag").string();
  constexpr const char* kMd5 = "0123456789abcdef0123456789abcdef";
  const BagWriterTopic topics[] = {{"/imu", "sensor_msgs/Imu", "", kMd5, false},
                                   {"/tf_static", "tf2_msgs/TFMessage", "", kMd5, true},
                                   {"/image", "sensor_msgs/Image", "", kMd5, false}};
  rosbag::Bag bag(theirs, rosbag::bagmode::Write);
  const auto writer = makeRos1Writer(ours);
  for (int i = 0; i < 200; ++i) {  // several chunks, the first two topics not in each
    const std::size_t which = i == 1 ? 1 : (i % 10 == 9 ? 2 : 0);
    const BagWriterTopic& topic = topics[which];
    if (i == 0 || i == 1 || i == 9) CHECK(writer->addTopic(topic) == which);
    const Stamp stamp{asl.stamp(0) + i / 2 * 1'000'000};
    const std::vector<std::uint8_t> body(which == 2 ? 100'000 : 30, static_cast<std::uint8_t>(i));
    writer->write(static_cast<std::uint32_t>(which), stamp, 0, body);
    test::raw_type = topic.type;
    boost::shared_ptr<ros::M_string> fields;
    if (topic.latched) {
      fields = boost::make_shared<ros::M_string>(ros::M_string{{"topic", topic.name},
                                                               {"type", topic.type},
                                                               {"md5sum", kMd5},
                                                               {"message_definition", ""},
                                                               {"latching", "1"}});
    }
    ros::Time time;
    time.fromNSec(static_cast<std::uint64_t>(stamp.ns));
    bag.write(topic.name, time, test::RawMessage{body}, fields);
  }
  bag.close();
  writer->finish();
  const bool same = test::textOf(theirs) == test::textOf(ours);
  CHECK(same);
}

TEST_CASE("damaged messages and cut bags are said", "[ros_bag]") {
  BagFixture bag;
  bag.putAll(false);
  bag.put("/imu0", "sensor_msgs/Imu", bag.asl.stamp(0), {1, 2, 3});
  bag.put("/imu0", "sensor_msgs/Imu", bag.asl.stamp(0),
          test::imuBody({bag.asl.stamp(0) + 1}, {0, std::nan(""), 0}, {0, 0, 9.8}));
  bag.close();
  const auto log = openLog(bag.path(), bag.options());
  CHECK(log->counters().bad_rows == 1);
  CHECK(log->counters().nan_rows == 1);
  CHECK(test::readAll(*log).frames.size() == 12);
  fs::resize_file(bag.path(), fs::file_size(bag.path()) / 2);  // in its only chunk
  CHECK(errorOf([&] { openLog(bag.path(), bag.options()); }).file == bag.path());
}

}  // namespace
}  // namespace swiftlet
