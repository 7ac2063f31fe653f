#pragma once
// Decodes JPEG and PNG to 8-bit grey, directly into the caller's memory.
//
// JPEG: the luma plane, through libjpeg-turbo with its exact integer transform. PNG: grey of any depth (16
// bits scaled to 8, rounded), colour by luma weights, alpha ignored, interlaced images too. The format is
// detected from the first bytes, not from the file name. A truncated image is damaged, even if the decoder
// could fill in the rest. Memory: the decoders' own (some 100 KiB while decoding). Not thread safe; one
// decoder per thread.

#include <cstdint>
#include <span>

#include "drivers/image/jpeg_grey.hpp"

namespace swiftlet {

class ImageDecoder {
 public:
  /// Decodes into `out` of expected.width * expected.height bytes, rows without padding. `found` is set as
  /// soon as the header was read; a size other than `expected` gives kWrongSize.
  DecodeResult decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                      ImageSize& found);
  /// 16-bit grey PNG, values unchanged (depth images); any other image is damaged.
  static DecodeResult decode16(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint16_t* out,
                               ImageSize& found);

 private:
  JpegGrey jpeg_;
};

}  // namespace swiftlet
