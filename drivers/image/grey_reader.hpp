#pragma once
// The 8-bit grey images of a camera's frames, one or two of each, whatever the format.
//
// - Luma as it is: its range, 16 to 235 as a rule, is not stretched. Deeper pixels: their upper 8 bits.
// - A sensor behind a Bayer filter: at each pixel the binomial mean of 3x3, (1 2 1)' (1 2 1) / 16, mirrored
//   at the border. Whatever the colour of the pixel, red, green and blue have the weights 1/4, 1/2, 1/4 in
//   it: no pattern is left, and the four orders of colours need not be told apart. It costs what a blur of
//   0.7 px costs.
// - Words of less than 16 bits stand at the lower end, as V4L2 says, or at the upper one, as the Jetson
//   Xavier delivers them: an image with more than half of its rows beyond the lower range is of the latter
//   kind, and so are all that follow.
// - JPEG, and PNG in its place: drivers/image/image_decoder.hpp.
//
// Errors: a damaged picture gives no images. Memory: of the images and of three rows, in reserve(); a
// picture's codec allocates, nothing else does. Cost: a load and a store for each pixel, about 15 operations
// behind a Bayer filter; nothing for 8-bit grey, whose images lie in the camera's own memory.

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
  /// For frames of this size and format. `side_by_side`: two cameras in the halves of each.
  void reserve(const PixelFormat& format, int width, int height, bool side_by_side);

  /// Views of one image or two; none: the picture is damaged. They hold until the next call, and no longer
  /// than the frame that they are made of.
  [[nodiscard]] std::span<const ImageView> read(const RawImage& frame);

 private:
  [[nodiscard]] ImageView convert(const RawImage& image, std::uint8_t* out);
  void smoothMosaic(const RawImage& image, std::uint8_t* out);
  [[nodiscard]] unsigned shiftOf(const RawImage& image);

  bool side_by_side_ = false;
  bool upper_end_ = false;  ///< words stand at the upper end of 16 bits
  unsigned shift_ = 0;      ///< of the frame's words
  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint8_t> rows_;   ///< three, unpacked
  std::vector<std::uint16_t> sums_;  ///< over three rows, with a pixel more at both ends
  ImageDecoder decoder_;
  std::array<ImageView, 2> images_ = {};
};

}  // namespace swiftlet
