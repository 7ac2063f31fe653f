#pragma once
// Converts raw pixels of ROS Image messages to 8-bit grey without row padding, for all encodings that
// rosEncoding() knows.

#include <cstdint>

#include "drivers/bag/ros_messages.hpp"
#include "drivers/image/grey_reader.hpp"
#include "drivers/image/image_decoder.hpp"

namespace swiftlet {

class GreyCopier {
 public:
  /// kUnknownFormat for other encodings, kDamaged if the data are too short. `found`: the image's size.
  DecodeResult copy(const rosmsg::Image& image, ImageSize expected, std::uint8_t* out, ImageSize& found);

 private:
  GreyReader reader_;
  PixelFormat format_;  ///< format that reader_ has memory for, at this size_
  ImageSize size_;
};

}  // namespace swiftlet
