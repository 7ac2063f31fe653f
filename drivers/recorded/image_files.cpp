#include "drivers/recorded/image_files.hpp"

#include <png.h>
#include <turbojpeg.h>

#include <csetjmp>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <vector>

namespace swiftlet {
namespace {

// Camera noise does not compress: a low level takes a fifth of the time for 2 % more bytes.
constexpr int kPngLevel = 2;

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

File openForWriting(const std::string& path) {
  File file(std::fopen(path.c_str(), "wb"));
  if (file == nullptr) throw std::runtime_error(path + ": cannot be written");
  return file;
}

void appendBytes(png_structp png, png_bytep data, png_size_t size) {
  auto* bytes = static_cast<std::vector<std::uint8_t>*>(png_get_io_ptr(png));
  bytes->insert(bytes->end(), data, data + size);
}

void writeAll(const std::string& path, const std::uint8_t* data, std::size_t size) {
  const File file = openForWriting(path);
  if (std::fwrite(data, 1, size, file.get()) != size || std::fflush(file.get()) != 0) {
    throw std::runtime_error(path + ": writing failed (disk full?)");
  }
}

// False if libpng reports an error, which it does by longjmp to this setjmp: no object with a destructor may
// be created in this function.
bool encodePng(png_structp png, png_infop info, const std::uint8_t* rows, std::ptrdiff_t stride, int width,
               int height, int depth, int colour) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), depth, colour,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, kPngLevel);
  png_set_filter(png, 0, PNG_FILTER_UP);
  png_write_info(png, info);
  if (depth == 16) png_set_swap(png);  // the file is big-endian
  for (int y = 0; y < height; ++y) png_write_row(png, rows + y * stride);
  png_write_end(png, info);
  return true;
}

void writePng(const std::string& path, const std::uint8_t* rows, std::ptrdiff_t stride, int width, int height,
              int depth, int colour = PNG_COLOR_TYPE_GRAY) {
  std::vector<std::uint8_t> bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  bool good = info != nullptr;
  if (good) {
    png_set_write_fn(png, &bytes, appendBytes, nullptr);
    good = encodePng(png, info, rows, stride, width, height, depth, colour);
  }
  png_destroy_write_struct(&png, &info);
  if (!good) throw std::runtime_error(path + ": the PNG encoder failed");
  writeAll(path, bytes.data(), bytes.size());
}

}  // namespace

void writePng8(const std::string& path, const std::uint8_t* grey, int width, int height) {
  writePng(path, grey, width, width, height, 8);
}

void writePng16(const std::string& path, const std::uint16_t* grey, int width, int height) {
  writePng(path, reinterpret_cast<const std::uint8_t*>(grey), 2 * static_cast<std::ptrdiff_t>(width), width,
           height, 16);
}

void writePngRgb8(const std::string& path, const std::uint8_t* rgb, int width, int height) {
  writePng(path, rgb, 3 * static_cast<std::ptrdiff_t>(width), width, height, 8, PNG_COLOR_TYPE_RGB);
}

std::vector<std::uint8_t> encodeJpeg(const std::uint8_t* grey, int width, int height, int quality) {
  const std::unique_ptr<void, int (*)(tjhandle)> encoder(tjInitCompress(), tjDestroy);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  const int result = encoder == nullptr ? -1
                                        : tjCompress2(encoder.get(), grey, width, width, height, TJPF_GRAY,
                                                      &data, &size, TJSAMP_GRAY, quality, TJFLAG_ACCURATEDCT);
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(data, tjFree);
  if (result != 0) throw std::runtime_error("the JPEG encoder failed");
  return {data, data + size};
}

void writeJpeg(const std::string& path, const std::uint8_t* grey, int width, int height, int quality) {
  const std::vector<std::uint8_t> bytes = encodeJpeg(grey, width, height, quality);
  writeAll(path, bytes.data(), bytes.size());
}

}  // namespace swiftlet
