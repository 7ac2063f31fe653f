#include "drivers/image/jpeg_grey.hpp"

#include <turbojpeg.h>

#include <string_view>

namespace swiftlet {
namespace {

/// The codec's warning about extra bytes before the end marker, which some cameras write: the picture is
/// complete.
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
  // A file cut before the frame header passes as "tables only", without a size.
  const bool header = handle_ != nullptr &&
                      tjDecompressHeader3(handle_, bytes.data(), bytes.size(), &found.width, &found.height,
                                          &subsampling, &colour_space) == 0 &&
                      found.width > 0 && found.height > 0;
  if (header && found != expected) result = DecodeResult::kWrongSize;
  // Warnings, which the codec gives for a truncated picture, count as damage.
  if (header && found == expected &&
      (tjDecompress2(handle_, bytes.data(), bytes.size(), out, expected.width, expected.width,
                     expected.height, TJPF_GRAY, 0) == 0 ||
       harmless(handle_))) {
    result = DecodeResult::kOk;
  }
  if (result == DecodeResult::kDamaged) {
    // After an error inside a header the handle keeps its state and would spoil the next picture.
    if (handle_ != nullptr) tjDestroy(handle_);
    handle_ = tjInitDecompress();
  }
  return result;
}

}  // namespace swiftlet
