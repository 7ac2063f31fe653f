#include <cstring>

#include "drivers/bag/message_coder.hpp"
#include "drivers/recorded/grey_copier.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/drivers/recorded/ros_bodies.hpp"

namespace swiftlet {
namespace {

TEST_CASE("an Imu body gives stamp, gyro and accel; every shorter one nothing", "[ros]") {
  const std::vector<std::uint8_t> body =
      test::imuBody({1403636579763555584}, {0.1, -0.2, 0.3}, {9.7, 0.5, -1.2});
  rosmsg::Imu imu;
  REQUIRE(decode(body, BagEncoding::kRos1, imu));
  CHECK(imu.header.seq == 42);
  CHECK(imu.header.stamp.ns == 1403636579763555584);
  CHECK(imu.header.frame_id == "frame");
  CHECK(imu.angular_velocity.y == -0.2);
  CHECK(imu.linear_acceleration.x == 9.7);
  CHECK(imu.linear_acceleration.z == -1.2);
  for (std::size_t n = 0; n < body.size(); ++n) {
    CHECK(!decode(std::span(body).first(n), BagEncoding::kRos1, imu));
  }
}

TEST_CASE("raw encodings become grey, with padded rows", "[ros]") {
  const int width = 5;
  const int height = 3;
  const ImageSize size{width, height};
  std::vector<std::uint8_t> out(15);
  rosmsg::Image image;
  GreyCopier copier;
  const auto convert = [&](const std::vector<std::uint8_t>& body) {
    ImageSize found;
    REQUIRE(decode(body, BagEncoding::kRos1, image));
    return copier.copy(image, size, out.data(), found);
  };
  SECTION("mono8") {
    const std::vector<std::uint8_t> grey = test::pattern(width, height, 1);
    std::vector<std::uint8_t> padded;
    for (int y = 0; y < height; ++y) {
      padded.insert(padded.end(), grey.begin() + y * width, grey.begin() + (y + 1) * width);
      padded.insert(padded.end(), 3, 0xEE);
    }
    REQUIRE(convert(test::imageBody({7}, width, height, "mono8", 8, padded)) == DecodeResult::kOk);
    CHECK(out == grey);
    CHECK(image.header.stamp.ns == 7);
  }
  SECTION("mono16, both byte orders") {
    std::vector<std::uint8_t> little;
    std::vector<std::uint8_t> big;
    std::vector<std::uint8_t> truth;
    for (int i = 0; i < 15; ++i) {
      const int value = i * 4681;
      little.insert(little.end(),
                    {static_cast<std::uint8_t>(value & 255), static_cast<std::uint8_t>(value >> 8)});
      big.insert(big.end(), {static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value & 255)});
      truth.push_back(static_cast<std::uint8_t>(value >> 8));
    }
    REQUIRE(convert(test::imageBody({7}, width, height, "mono16", 10, little)) == DecodeResult::kOk);
    CHECK(out == truth);
    REQUIRE(convert(test::imageBody({7}, width, height, "mono16", 10, big, true)) == DecodeResult::kOk);
    CHECK(out == truth);
  }
  SECTION("colour") {
    std::vector<std::uint8_t> bgr;
    for (int i = 0; i < 15; ++i) bgr.insert(bgr.end(), {10, 20, 200});
    REQUIRE(convert(test::imageBody({7}, width, height, "bgr8", 15, bgr)) == DecodeResult::kOk);
    CHECK(out[0] == 73);  // 0.299 * 200 + 0.587 * 20 + 0.114 * 10
    REQUIRE(convert(test::imageBody({7}, width, height, "rgb8", 15, bgr)) == DecodeResult::kOk);
    CHECK(out[0] == 38);
  }
  SECTION("faults") {
    const std::vector<std::uint8_t> grey = test::pattern(width, height, 1);
    CHECK(convert(test::imageBody({7}, width, height, "32FC1", 20, grey)) == DecodeResult::kUnknownFormat);
    CHECK(convert(test::imageBody({7}, height, width, "mono8", 5, grey)) == DecodeResult::kWrongSize);
    CHECK(convert(test::imageBody({7}, width, height, "mono8", 6, grey)) == DecodeResult::kDamaged);
    CHECK(convert(test::imageBody({7}, width, height, "mono8", 4, grey)) == DecodeResult::kDamaged);
    std::vector<std::uint8_t> body = test::imageBody({7}, width, height, "mono8", 5, grey);
    for (std::size_t n = 0; n < body.size(); ++n) {
      CHECK(!decode(std::span(body).first(n), BagEncoding::kRos1, image));
    }
  }
}

}  // namespace
}  // namespace swiftlet
