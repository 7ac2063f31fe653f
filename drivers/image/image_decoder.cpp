#include "drivers/image/image_decoder.hpp"

#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>

namespace swiftlet {
namespace {

constexpr std::array<std::uint8_t, 3> kJpegMagic = {0xFF, 0xD8, 0xFF};
constexpr std::array<std::uint8_t, 8> kPngMagic = {0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A};

/// Bytes per pixel.
enum class Grey : std::uint8_t { k8 = 1, k16 = 2 };

struct PngInput {
  const std::uint8_t* next;
  std::size_t left;
};

void readPngBytes(png_structp png, png_bytep out, png_size_t count) {
  auto* input = static_cast<PngInput*>(png_get_io_ptr(png));
  if (count > input->left) png_error(png, "is truncated");
  std::memcpy(out, input->next, count);
  input->next += count;
  input->left -= count;
}

void onPngError(png_structp png, png_const_charp) { png_longjmp(png, 1); }
void onPngWarning(png_structp, png_const_charp) {}

void askForGrey8(png_structp png, png_infop info) {
  const int type = png_get_color_type(png, info);
  const int depth = png_get_bit_depth(png, info);
  if (type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  if (type == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_expand_gray_1_2_4_to_8(png);
  if (depth == 16) png_set_scale_16(png);
  if ((type & PNG_COLOR_MASK_COLOR) != 0) png_set_rgb_to_gray_fixed(png, PNG_ERROR_ACTION_NONE, -1, -1);
  if ((type & PNG_COLOR_MASK_ALPHA) != 0) png_set_strip_alpha(png);
}

/// Requests two bytes per pixel in host byte order. False if the file is not 16-bit grey.
bool askForGrey16(png_structp png, png_infop info) {
  if (png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY || png_get_bit_depth(png, info) != 16)
    return false;
  if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  return true;
}

// libpng reports errors by longjmp: no object with a destructor may be in this function, and values changed
// after setjmp must be behind pointers.
DecodeResult readPng(png_structp png, png_infop info, PngInput* input, ImageSize expected, Grey grey,
                     std::uint8_t* out, ImageSize* found) {
  if (setjmp(png_jmpbuf(png)) != 0) return DecodeResult::kDamaged;
  png_set_user_limits(png, kMaxImageSide, kMaxImageSide);
  png_set_read_fn(png, input, &readPngBytes);
  png_read_info(png, info);
  found->width = static_cast<int>(png_get_image_width(png, info));
  found->height = static_cast<int>(png_get_image_height(png, info));
  if (*found != expected) return DecodeResult::kWrongSize;
  if (grey == Grey::k8) {
    askForGrey8(png, info);
  } else if (!askForGrey16(png, info)) {
    return DecodeResult::kDamaged;
  }
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const int row_bytes = expected.width * static_cast<int>(grey);
  if (png_get_rowbytes(png, info) != static_cast<png_size_t>(row_bytes)) return DecodeResult::kDamaged;
  for (int pass = 0; pass < passes; ++pass) {
    for (int y = 0; y < expected.height; ++y) {
      png_read_row(png, out + static_cast<std::ptrdiff_t>(y) * row_bytes, nullptr);
    }
  }
  png_read_end(png, nullptr);
  return DecodeResult::kOk;
}

DecodeResult decodePng(std::span<const std::uint8_t> bytes, ImageSize expected, Grey grey, std::uint8_t* out,
                       ImageSize& found) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, &onPngError, &onPngWarning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr) {
    png_destroy_read_struct(&png, nullptr, nullptr);
    return DecodeResult::kDamaged;
  }
  PngInput input{bytes.data(), bytes.size()};
  const DecodeResult result = readPng(png, info, &input, expected, grey, out, &found);
  png_destroy_read_struct(&png, &info, nullptr);
  return result;
}

template <typename Magic>
bool beginsWith(std::span<const std::uint8_t> bytes, const Magic& magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

}  // namespace

DecodeResult ImageDecoder::decode(std::span<const std::uint8_t> bytes, ImageSize expected, std::uint8_t* out,
                                  ImageSize& found) {
  found = {};
  if (beginsWith(bytes, kJpegMagic)) return jpeg_.decode(bytes, expected, out, found);
  if (beginsWith(bytes, kPngMagic)) return decodePng(bytes, expected, Grey::k8, out, found);
  return bytes.empty() ? DecodeResult::kDamaged : DecodeResult::kUnknownFormat;
}

DecodeResult ImageDecoder::decode16(std::span<const std::uint8_t> bytes, ImageSize expected,
                                    std::uint16_t* out, ImageSize& found) {
  found = {};
  if (!beginsWith(bytes, kPngMagic))
    return bytes.empty() ? DecodeResult::kDamaged : DecodeResult::kUnknownFormat;
  return decodePng(bytes, expected, Grey::k16, reinterpret_cast<std::uint8_t*>(out), found);
}

}  // namespace swiftlet
