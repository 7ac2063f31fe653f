// Messages of cameras' topics as images: each encoding by its grey, and every kind of malformed one refused
// by name; what a user is told of a topic that nobody publishes.

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "drivers/dds/topic_camera.hpp"
#include "drivers/dds/topic_search.hpp"
#include "drivers/image/grey_reader.hpp"

namespace swiftlet {
namespace {

constexpr int kWidth = 6;
constexpr int kHeight = 4;

struct Case {
  const char* encoding;
  int pixel;             ///< bytes
  std::uint8_t grey[6];  ///< bytes of a pixel of grey 200, or of two
};

/// Rows with three bytes of padding, whose pixels are all the same.
std::vector<std::uint8_t> rowsOf(const Case& c) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth * c.pixel; ++x) bytes.push_back(c.grey[x % 6]);
    bytes.insert(bytes.end(), 3, 0x55);
  }
  return bytes;
}

TopicImage messageOf(const Case& c, const std::vector<std::uint8_t>& bytes) {
  TopicImage message;
  message.encoding = c.encoding;
  message.width = kWidth;
  message.height = kHeight;
  message.step = static_cast<std::uint32_t>(kWidth * c.pixel + 3);
  message.data = bytes;
  return message;
}

TEST_CASE("encodings are read as grey, rows with gaps too") {
  const Case cases[] = {
      {"mono8", 1, {200, 200, 200, 200, 200, 200}}, {"8UC1", 1, {200, 200, 200, 200, 200, 200}},
      {"mono16", 2, {7, 200, 9, 200, 11, 200}},     {"rgb8", 3, {200, 200, 200, 200, 200, 200}},
      {"bgr8", 3, {200, 200, 200, 200, 200, 200}},  {"yuv422", 2, {1, 200, 2, 200, 3, 200}},
      {"yuv422_yuy2", 2, {200, 1, 200, 2, 200, 3}}, {"bayer_rggb8", 1, {200, 200, 200, 200, 200, 200}},
      {"nv12", 1, {200, 200, 200, 200, 200, 200}},
  };
  for (const Case& c : cases) {
    CAPTURE(c.encoding);
    const std::vector<std::uint8_t> bytes = rowsOf(c);
    RawImage image;
    REQUIRE(rawImageOf(messageOf(c, bytes), kWidth, kHeight, image).ok());
    GreyReader reader;
    reader.reserve(image.format, kWidth, kHeight, false);
    const auto views = reader.read(image);
    REQUIRE(views.size() == 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) CHECK(std::abs(views[0].row(y)[x] - 200) <= 1);
    }
  }
}

TEST_CASE("malformed images are refused by name") {
  const Case mono = {"mono8", 1, {1, 2, 3, 4, 5, 6}};
  const std::vector<std::uint8_t> bytes = rowsOf(mono);
  const auto refused = [&](const TopicImage& message) {
    RawImage image;
    const DeviceFault fault = rawImageOf(message, kWidth, kHeight, image);
    CHECK(image.empty());
    return std::string(fault.text());
  };
  TopicImage message = messageOf(mono, bytes);
  message.encoding = "32FC1";
  CHECK_THAT(refused(message), Catch::Contains("32FC1"));
  message = messageOf(mono, bytes);
  const std::string long_name(100'000, 'x');
  message.encoding = long_name;
  CHECK_THAT(refused(message), Catch::Contains("xxx"));
  for (const std::uint32_t step : {0U, 5U, 0xffffffffU}) {
    message = messageOf(mono, bytes);
    message.step = step;
    CHECK_THAT(refused(message), Catch::Contains("step of " + std::to_string(step)));
  }
  for (const std::uint32_t side : {0U, 5U, 7U, 0xffffffffU}) {
    message = messageOf(mono, bytes);
    message.width = side;
    CHECK_THAT(refused(message), Catch::Contains("calibration is for 6x4"));
  }
  message = messageOf(mono, bytes);
  message.data = message.data.first(32);  // a pixel less than the last row's end
  CHECK_THAT(refused(message), Catch::Contains("32 bytes of data, expected 33"));
  // The gap after the last row may be left out.
  message.data = std::span(bytes).first(33);
  RawImage image;
  CHECK(rawImageOf(message, kWidth, kHeight, image).ok());
  message.compressed = true;
  message.data = {};
  image = {};
  CHECK_THAT(refused(message), Catch::Contains("empty"));
}

TEST_CASE("a missing topic is told with those that are near") {
  const std::vector<PublishedTopic> published = {
      {"/camera/camera/imu", "sensor_msgs/msg/Imu"},
      {"/camera/camera/infra1/image_rect_raw", "sensor_msgs/msg/Image"},
      {"/camera/camera/infra2/image_rect_raw", "sensor_msgs/msg/Image"},
      {"/other/picture", "sensor_msgs/msg/Image"},
      {"/far/away/from/it/all", "sensor_msgs/msg/Image"}};
  CHECK(missingTopic(published, "sensor_msgs/msg/Image", "/camera/infra1/image_rect_raw") ==
        "no publisher of sensor_msgs/msg/Image on /camera/infra1/image_rect_raw; near: "
        "/camera/camera/infra1/image_rect_raw, /camera/camera/infra2/image_rect_raw, /other/picture");
  CHECK_THAT(missingTopic(published, "sensor_msgs/msg/Image", "/camera/camera/imu"),
             Catch::Contains("is a sensor_msgs/msg/Imu"));
  CHECK_THAT(missingTopic({}, "sensor_msgs/msg/Image", "/a"), Catch::Contains("nor on any other"));
}

}  // namespace
}  // namespace swiftlet
