#include "drivers/recorded/ros_messages.hpp"

#include <bit>
#include <cstring>
#include <optional>

#include "drivers/image/ros_encoding.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

static_assert(std::endian::native == std::endian::little, "bodies are copied as they are");

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

DecodeResult GreyCopier::copy(const RosImage& image, ImageSize expected, std::uint8_t* out) {
  const std::optional<PixelFormat> format = rosEncoding(image.encoding, image.big_endian);
  if (!format) return DecodeResult::kUnknownFormat;
  if (image.size != expected) return DecodeResult::kWrongSize;
  const auto width = static_cast<std::size_t>(expected.width);
  const auto height = static_cast<std::size_t>(expected.height);
  const auto row = static_cast<std::size_t>(format->rowBytes(expected.width));
  if (width == 0 || height == 0 || image.step < row || image.data.size() < image.step * (height - 1) + row)
    return DecodeResult::kDamaged;
  if (*format != format_ || expected != size_) {
    format_ = *format;
    size_ = expected;
    reader_.reserve(format_, size_.width, size_.height, false);
  }
  RawImage raw;
  raw.data = image.data.data();
  raw.width = expected.width;
  raw.height = expected.height;
  raw.stride = static_cast<int>(image.step);
  raw.format = *format;
  const ImageView grey = reader_.read(raw)[0];
  for (int y = 0; y < grey.height; ++y) {
    std::memcpy(out + static_cast<std::size_t>(y) * width, grey.row(y), width);
  }
  return DecodeResult::kOk;
}

}  // namespace swiftlet
