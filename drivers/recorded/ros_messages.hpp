#pragma once
// ROS 1 message bodies, read by hand: packed little-endian, strings and arrays with a 32-bit length.
// Only what a log needs: sensor_msgs/Imu, Image and CompressedImage. Every read is bounds-checked; a
// body that ends early gives false.

#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/image/grey_reader.hpp"
#include "drivers/image/image_decoder.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

struct RosImage {
  Stamp stamp;                ///< header stamp
  ImageSize size;             ///< {0, 0} for a compressed picture
  std::uint32_t step = 0;     ///< bytes from row to row
  std::string_view encoding;  ///< "mono8", ..., or the compressed picture's format
  bool big_endian = false;
  std::span<const std::uint8_t> data;  ///< views into the body
};

bool readRosImu(std::span<const std::uint8_t> body, ImuSample& sample);
bool readRosImage(std::span<const std::uint8_t> body, RosImage& image);
bool readRosCompressedImage(std::span<const std::uint8_t> body, RosImage& image);
/// Only the stamp of the header any message with one begins with.
bool readRosStamp(std::span<const std::uint8_t> body, Stamp& stamp);

/// Raw pixels to 8-bit grey, rows packed, of all encodings that rosEncoding() knows.
class GreyCopier {
 public:
  /// kUnknownFormat for other encodings, kDamaged when the data are too short.
  DecodeResult copy(const RosImage& image, ImageSize expected, std::uint8_t* out);

 private:
  GreyReader reader_;
  PixelFormat format_;  ///< what reader_ has memory for, with size_
  ImageSize size_;
};

}  // namespace swiftlet
