#include "drivers/image/jpeg_grey.hpp"

#include <turbojpeg.h>

#include <string_view>

namespace swiftlet {
namespace {

/// The codec's warning about stray bytes in front of a picture's end, which some cameras put there: all of
/// the picture is before them.
constexpr std::string_view kHarmless = "extraneous bytes before marker 0xd9";

bool harmless(tjhandle codec) {
  return tjGetErrorCode(codec) == TJERR_WARNING &&
         std::string_view(tjGetErrorStr2(codec)).find(kHarmless) != std::string_view::npos;
}

}  // namespace

JpegGrey::JpegGrey() : handle_(tjInitDecompress()) {}

JpegGrey::~JpegGrey() {
  if (handle_ != nullptr) tjDestroy(handle_);
}

DecodeResult JpegGrey::decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                              ImageSize& found) {
  found = {};
  int subsampling = 0;
  int colour_space = 0;
  DecodeResult result = DecodeResult::kDamaged;
  // A file cut before the frame header passes as "tables only", with no size.
  const bool header = handle_ != nullptr &&
                      tjDecompressHeader3(handle_, bytes.data(), bytes.size(), &found.width, &found.height,
                                          &subsampling, &colour_space) == 0 &&
                      found.width > 0 && found.height > 0;
  if (header && found != expected) result = DecodeResult::kWrongSize;
  // A warning (the codec's word for a picture that ends early) counts as damage like an error.
  if (header && found == expected &&
      (tjDecompress2(handle_, bytes.data(), bytes.size(), out, expected.width, expected.width,
                     expected.height, TJPF_GRAY, 0) == 0 ||
       harmless(handle_))) {
    result = DecodeResult::kOk;
  }
  if (result == DecodeResult::kDamaged) {
    // After an error inside a header the handle keeps the half-read state and would spoil the next picture.
    if (handle_ != nullptr) tjDestroy(handle_);
    handle_ = tjInitDecompress();
  }
  return result;
}

}  // namespace swiftlet
