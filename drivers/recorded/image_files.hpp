#pragma once
// Writes grey images: 8 and 16 bit PNG (libpng), 8 bit JPEG (libjpeg-turbo); and 8 bit PNG in colours. Throws
// std::runtime_error naming the file.

#include <cstdint>
#include <string>
#include <vector>

namespace swiftlet {

void writePng8(const std::string& path, const std::uint8_t* grey, int width, int height);
void writePng16(const std::string& path, const std::uint16_t* grey, int width, int height);
/// `rgb`: red, green, blue of each pixel.
void writePngRgb8(const std::string& path, const std::uint8_t* rgb, int width, int height);
/// A JPEG file's bytes; the same for the same pixels. std::runtime_error where there is no memory.
std::vector<std::uint8_t> encodeJpeg(const std::uint8_t* grey, int width, int height, int quality);
void writeJpeg(const std::string& path, const std::uint8_t* grey, int width, int height, int quality);

}  // namespace swiftlet
