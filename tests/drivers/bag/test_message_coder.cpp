// Messages against bodies that are laid out by hand after the specification of CDR and of ROS 1.

#include <bit>
#include <cstring>

#include "drivers/bag/message_coder.hpp"
#include "drivers/bag/message_text.hpp"
#include "tests/drivers/bag/bag_fixture.hpp"

namespace swiftlet {
namespace {

/// Fields one by one, aligned behind the header; nothing of ours.
class CdrBody {
 public:
  explicit CdrBody(bool little)
      : little_(little), bytes_({0, static_cast<std::uint8_t>(little ? 1 : 0), 0, 0}) {}
  template <typename T>
  CdrBody& put(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_.push_back(0);
    std::array<std::uint8_t, sizeof(T)> word;
    std::memcpy(word.data(), &value, sizeof(T));
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes_.push_back(word[little_ ? i : sizeof(T) - 1 - i]);
    return *this;
  }
  CdrBody& text(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back(0);
    return *this;
  }
  CdrBody& bytes(const std::vector<std::uint8_t>& data) {
    put(static_cast<std::uint32_t>(data.size()));
    bytes_.insert(bytes_.end(), data.begin(), data.end());
    return *this;
  }
  [[nodiscard]] const std::vector<std::uint8_t>& all() const { return bytes_; }

 private:
  bool little_;
  std::vector<std::uint8_t> bytes_;
};

CdrBody imuBody(bool little, const std::string& frame) {
  CdrBody body(little);
  body.put(std::int32_t{1700000000}).put(std::uint32_t{5}).text(frame);
  for (int i = 0; i < 4 + 9 + 3 + 9 + 3 + 9; ++i) body.put(0.5 * i);
  return body;
}

TEST_CASE("CDR of both byte orders is read, with every alignment of what stands before", "[cdr]") {
  for (const bool little : {true, false}) {
    for (const char* frame : {"", "a", "ab", "abc", "abcd", "imu_link"}) {
      const std::vector<std::uint8_t> body = imuBody(little, frame).all();
      rosmsg::Imu imu;
      REQUIRE(decode(body, BagEncoding::kCdr, imu));
      CHECK(imu.header.stamp.ns == 1'700'000'000'000'000'005);
      CHECK(imu.header.frame_id == frame);
      CHECK(imu.orientation.w == 1.5);
      CHECK(imu.orientation_covariance[0] == 2);
      CHECK(imu.angular_velocity.x == 6.5);
      CHECK(imu.linear_acceleration.z == 13.5);
      CHECK(imu.linear_acceleration_covariance[8] == 18);
      for (std::size_t n = 0; n < body.size(); ++n) {
        CHECK_FALSE(decode(std::span(body).first(n), BagEncoding::kCdr, imu));
      }
      if (!little) continue;
      std::vector<std::uint8_t> again;
      REQUIRE(decode(body, BagEncoding::kCdr, imu));
      encode(imu, BagEncoding::kCdr, again);
      CHECK(again == body);
    }
  }
}

TEST_CASE("what is no CDR of version 1 is not read", "[cdr]") {
  std::vector<std::uint8_t> body = imuBody(true, "imu").all();
  rosmsg::Imu imu;
  for (const int kind : {2, 3, 6, 7, 10}) {
    body[1] = static_cast<std::uint8_t>(kind);
    CHECK_FALSE(decode(body, BagEncoding::kCdr, imu));
  }
  body = CdrBody(true).put(std::int32_t{1}).put(std::uint32_t{0}).put(std::uint32_t{3}).all();
  body.insert(body.end(), {'a', 'b', 'c'});  // without its NUL
  rosmsg::Header header;
  CHECK_FALSE(decode(body, BagEncoding::kCdr, header));
}

TEST_CASE("images and arrays of bytes are views into the body", "[cdr]") {
  const std::vector<std::uint8_t> pixels = {1, 2, 3, 4, 5, 6};
  CdrBody body(true);
  body.put(std::int32_t{-1}).put(std::uint32_t{999'999'999}).text("cam");
  body.put(std::uint32_t{2})
      .put(std::uint32_t{3})
      .text("mono8")
      .put(std::uint8_t{0})
      .put(std::uint32_t{3})
      .bytes(pixels);
  rosmsg::Image image;
  REQUIRE(decode(body.all(), BagEncoding::kCdr, image));
  CHECK(image.header.stamp.ns == -1);
  CHECK(image.height == 2);
  CHECK(image.width == 3);
  CHECK(image.encoding == "mono8");
  CHECK(std::equal(image.data.begin(), image.data.end(), pixels.begin(), pixels.end()));
  CHECK(image.data.data() + image.data.size() == body.all().data() + body.all().size());
  std::vector<std::uint8_t> again;
  encode(image, BagEncoding::kCdr, again);
  CHECK(again == body.all());
}

TEST_CASE("a wrong length of a sequence costs nothing", "[cdr]") {
  CdrBody body(true);
  body.put(std::uint32_t{0xFFFFFFFF}).put(std::uint32_t{7});
  rosmsg::TFMessage transforms;
  CHECK_FALSE(decode(body.all(), BagEncoding::kCdr, transforms));
  CHECK(transforms.transforms.size() < 4);
}

template <typename T>
void checkRoundTrip(const T& message) {
  for (const BagEncoding encoding : {BagEncoding::kRos1, BagEncoding::kCdr}) {
    std::vector<std::uint8_t> body;
    encode(message, encoding, body);
    T read;
    REQUIRE(decode(body, encoding, read));
    std::vector<std::uint8_t> again;
    encode(read, encoding, again);
    CHECK(again == body);
  }
}

TEST_CASE("messages with sequences of messages come back", "[cdr]") {
  rosmsg::Marker marker;
  marker.header.frame_id = "odom";
  marker.points = {{1, 2, 3}, {4, 5, 6}};
  marker.colors = {{1, 0.5F, 0, 1}};
  marker.text = "x";
  checkRoundTrip(marker);
  rosmsg::DiagnosticArray diagnostics;
  diagnostics.status.push_back({{1}, "a", "b", "c", {{"key", "value"}, {"k", ""}}});
  checkRoundTrip(diagnostics);
  rosmsg::CameraInfo info;
  info.distortion_model = "plumb_bob";
  info.d = {0.1, 0.2, 0.3, 0.4, 0.5};
  checkRoundTrip(info);
}

TEST_CASE("definitions name every field and all types behind it once", "[cdr]") {
  CHECK(definitionOf<rosmsg::CompressedImage>(BagEncoding::kRos1) ==
        "std_msgs/Header header\nstring format\nuint8[] data\n" + std::string(80, '=') +
            "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n");
  const std::string text = definitionOf<rosmsg::Odometry>(BagEncoding::kCdr);
  CHECK(text.find("float64[36] covariance\n") != std::string::npos);
  CHECK(text.find("MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n") != std::string::npos);
  CHECK(text.find("uint32 seq") == std::string::npos);
  const std::size_t first = text.find("MSG: geometry_msgs/Vector3\n");
  REQUIRE(first != std::string::npos);
  CHECK(text.find("MSG: geometry_msgs/Vector3\n", first + 1) == std::string::npos);
}

}  // namespace
}  // namespace swiftlet
