#pragma once
// Decodes JPEG to 8-bit grey: the luma plane, with libjpeg-turbo's exact integer transform.
//
// Camera pictures without Huffman tables are accepted: the codec has the standard ones. Errors: values. A
// truncated picture is damaged, even if the codec could fill in the rest. Memory: the codec's own, some 100
// KiB while decoding. It allocates: not for a thread of the flight path. One decoder per thread.

#include <cstdint>
#include <span>

namespace swiftlet {

inline constexpr int kMaxImageSide = 16384;  // pixels; a larger size is damage

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

  /// Writes rows without padding to `out`. `found`: the picture's size, zeros if it has no header.
  DecodeResult decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                      ImageSize& found);

 private:
  void* handle_;
};

}  // namespace swiftlet
