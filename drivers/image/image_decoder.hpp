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
  /// Decodes into `out` of expected.width * expected.height bytes, rows packed. `found` gets the
  /// picture's size as soon as its header was read; another size than expected gives kWrongSize.
  DecodeResult decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                      ImageSize& found);
  /// PNG of 16 bits grey, kept as written (depth images); everything else is damaged.
  static DecodeResult decode16(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint16_t* out,
                               ImageSize& found);

 private:
  JpegGrey jpeg_;
};

}  // namespace swiftlet
