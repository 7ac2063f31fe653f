#pragma once
// JPEG to 8-bit grey: the luma plane, through libjpeg-turbo with its exact integer transform.
//
// Pictures of cameras, which leave out their Huffman tables, are taken: the codec has the usual ones.
// Errors: values. A picture that ends early is damaged, even where the codec could fill in the rest.
// Memory: the codec's own, some 100 KiB while it decodes: it allocates, so not for a thread of the flight
// path. One decoder per thread.

#include <cstdint>
#include <span>

namespace swiftlet {

inline constexpr int kMaxImageSide = 16384;  // pixels; a larger one is damage, not a picture

enum class DecodeResult : std::uint8_t { kOk, kUnknownFormat, kDamaged, kWrongSize };

struct ImageSize {
  int width = 0;
  int height = 0;
  bool operator==(const ImageSize&) const = default;
};

class JpegGrey {
 public:
  JpegGrey();
  ~JpegGrey();
  JpegGrey(const JpegGrey&) = delete;
  JpegGrey& operator=(const JpegGrey&) = delete;

  /// Rows without padding into `out`. `found`: the picture's size, zeros where it has no header.
  DecodeResult decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                      ImageSize& found);

 private:
  void* handle_;
};

}  // namespace swiftlet
