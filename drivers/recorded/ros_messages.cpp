#include "drivers/recorded/ros_messages.hpp"

#include <bit>
#include <cstring>

#include "drivers/recorded/image_decoder.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

static_assert(std::endian::native == std::endian::little, "bodies are copied as they are");

// Luma weights of ITU-R BT.601 in 14 bits, rounding half up.
constexpr std::uint32_t kRed = 4899;
constexpr std::uint32_t kGreen = 9617;
constexpr std::uint32_t kBlue = 1868;
constexpr std::uint32_t kHalf = 1U << 13U;
constexpr std::uint32_t kShift = 14;

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  template <typename T>
  bool read(T& value) {
    if (rest_.size() < sizeof(T)) return false;
    std::memcpy(&value, rest_.data(), sizeof(T));
    rest_ = rest_.subspan(sizeof(T));
    return true;
  }
  bool skip(std::size_t bytes) {
    if (rest_.size() < bytes) return false;
    rest_ = rest_.subspan(bytes);
    return true;
  }
  bool readArray(std::span<const std::uint8_t>& bytes) {
    std::uint32_t length = 0;
    if (!read(length) || rest_.size() < length) return false;
    bytes = rest_.first(length);
    rest_ = rest_.subspan(length);
    return true;
  }
  bool readString(std::string_view& text) {
    std::span<const std::uint8_t> bytes;
    if (!readArray(bytes)) return false;
    text = {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    return true;
  }
  /// std_msgs/Header: seq, stamp, frame_id.
  bool readHeader(Stamp& stamp) {
    std::uint32_t sequence = 0;
    std::uint32_t seconds = 0;
    std::uint32_t nanoseconds = 0;
    std::string_view frame;
    if (!read(sequence) || !read(seconds) || !read(nanoseconds) || !readString(frame)) return false;
    stamp.ns = static_cast<std::int64_t>(seconds) * kNsPerSecond + nanoseconds;
    return true;
  }
  bool readVector(Eigen::Vector3d& v) { return read(v.x()) && read(v.y()) && read(v.z()); }

 private:
  std::span<const std::uint8_t> rest_;
};

struct PixelLayout {
  std::uint32_t bytes = 0;  ///< a pixel; 0 for an encoding that is not read
  bool wide = false;        ///< 16-bit grey
  std::uint32_t red = 0;    ///< channel offsets of colour
  std::uint32_t blue = 0;
};

PixelLayout layoutOf(std::string_view encoding) {
  if (encoding == "mono8" || encoding == "8UC1") return {1, false, 0, 0};
  if (encoding == "mono16" || encoding == "16UC1") return {2, true, 0, 0};
  if (encoding == "bgr8" || encoding == "8UC3") return {3, false, 2, 0};
  if (encoding == "rgb8") return {3, false, 0, 2};
  if (encoding == "bgra8") return {4, false, 2, 0};
  if (encoding == "rgba8") return {4, false, 0, 2};
  return {};
}

std::uint8_t greyOf(const std::uint8_t* pixel, const PixelLayout& layout, bool big_endian) {
  if (layout.bytes == 1) return *pixel;
  if (layout.wide) {
    const std::uint32_t value = big_endian ? (static_cast<std::uint32_t>(pixel[0]) << 8U) + pixel[1]
                                           : (static_cast<std::uint32_t>(pixel[1]) << 8U) + pixel[0];
    // value * 255 / 65535, rounded: as libpng scales 16 bits to 8.
    return static_cast<std::uint8_t>((value * 255U + 32895U) >> 16U);
  }
  const std::uint32_t sum = kRed * pixel[layout.red] + kGreen * pixel[1] + kBlue * pixel[layout.blue] + kHalf;
  return static_cast<std::uint8_t>(sum >> kShift);
}

}  // namespace

bool readRosStamp(std::span<const std::uint8_t> body, Stamp& stamp) {
  return ByteReader(body).readHeader(stamp);
}

bool readRosImu(std::span<const std::uint8_t> body, ImuSample& sample) {
  constexpr std::size_t kOrientation = 4 * sizeof(double);
  constexpr std::size_t kCovariance = 9 * sizeof(double);
  ByteReader reader(body);
  return reader.readHeader(sample.stamp) && reader.skip(kOrientation + kCovariance) &&
         reader.readVector(sample.gyro) && reader.skip(kCovariance) && reader.readVector(sample.accel);
}

bool readRosImage(std::span<const std::uint8_t> body, RosImage& image) {
  ByteReader reader(body);
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::uint8_t big_endian = 0;
  if (!reader.readHeader(image.stamp) || !reader.read(height) || !reader.read(width) ||
      !reader.readString(image.encoding) || !reader.read(big_endian) || !reader.read(image.step) ||
      !reader.readArray(image.data) || width > kMaxImageSide || height > kMaxImageSide) {
    return false;
  }
  image.size = {static_cast<int>(width), static_cast<int>(height)};
  image.big_endian = big_endian != 0;
  return true;
}

bool readRosCompressedImage(std::span<const std::uint8_t> body, RosImage& image) {
  ByteReader reader(body);
  image.size = {};
  return reader.readHeader(image.stamp) && reader.readString(image.encoding) && reader.readArray(image.data);
}

DecodeResult toGrey(const RosImage& image, ImageSize expected, std::uint8_t* out) {
  const PixelLayout layout = layoutOf(image.encoding);
  if (layout.bytes == 0) return DecodeResult::kUnknownFormat;
  if (image.size != expected) return DecodeResult::kWrongSize;
  const auto width = static_cast<std::size_t>(expected.width);
  const auto height = static_cast<std::size_t>(expected.height);
  if (image.step < width * layout.bytes || image.data.size() < image.step * height)
    return DecodeResult::kDamaged;
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* row = image.data.data() + y * image.step;
    if (layout.bytes == 1) {
      std::memcpy(out + y * width, row, width);
      continue;
    }
    for (std::size_t x = 0; x < width; ++x) {
      out[y * width + x] = greyOf(row + x * layout.bytes, layout, image.big_endian);
    }
  }
  return DecodeResult::kOk;
}

}  // namespace swiftlet
