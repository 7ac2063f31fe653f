#pragma once
// Converts the frames of a camera to 8-bit grey, one or two images per frame, from any format.
//
// - Luma is used unchanged: its range, usually 16 to 235, is not stretched. Deeper pixels: the upper 8 bits.
// - Sensors with a Bayer filter: the binomial mean of 3x3 at each pixel, (1 2 1)' (1 2 1) / 16, mirrored at
//   the border. Red, green and blue have the weights 1/4, 1/2, 1/4 for a pixel of any colour, so no pattern
//   remains and the four colour orders need not be distinguished. The cost is a blur of 0.7 px.
// - Words of less than 16 bits are stored at the lower end, as V4L2 specifies, or at the upper end, as the
//   Jetson Xavier delivers them. Once more than half of an image's rows exceed the lower range, it and all
//   later images are read from the upper end.
// - JPEG, and PNG instead of it: drivers/image/image_decoder.hpp.
//
// Errors: a damaged image gives no output. Memory: the images and three rows, in reserve(); only the decoder
// of compressed images allocates. Cost: a load and a store per pixel, about 15 operations with a Bayer
// filter; none for 8-bit grey, which is read in the camera's own memory.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/image/raw_image.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class GreyReader {
 public:
  /// Prepares for frames of this size and format. `side_by_side`: each holds the images of two cameras in its
  /// halves.
  void reserve(const PixelFormat& format, int width, int height, bool side_by_side);

  /// Views of one or two images; none: the image is damaged. Valid until the next call, and no longer than
  /// the frame.
  [[nodiscard]] std::span<const ImageView> read(const RawImage& frame);

 private:
  [[nodiscard]] ImageView convert(const RawImage& image, std::uint8_t* out);
  void smoothMosaic(const RawImage& image, std::uint8_t* out);
  [[nodiscard]] unsigned shiftOf(const RawImage& image);

  bool side_by_side_ = false;
  bool upper_end_ = false;  ///< words are stored at the upper end of 16 bits
  unsigned shift_ = 0;      ///< of the frame's words
  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint8_t> rows_;   ///< three unpacked rows
  std::vector<std::uint16_t> sums_;  ///< over three rows, with one more pixel at both ends
  ImageDecoder decoder_;
  std::array<ImageView, 2> images_ = {};
};

}  // namespace swiftlet
