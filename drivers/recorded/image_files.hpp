#pragma once
// Writes grey images as 8 and 16 bit PNG (libpng) and 8 bit JPEG (libjpeg-turbo), and colour images as 8 bit
// PNG. Throws std::runtime_error naming the file.

#include <cstdint>
#include <string>
#include <vector>

namespace swiftlet {

void writePng8(const std::string& path, const std::uint8_t* grey, int width, int height);
void writePng16(const std::string& path, const std::uint16_t* grey, int width, int height);
/// `rgb`: red, green and blue bytes of each pixel.
void writePngRgb8(const std::string& path, const std::uint8_t* rgb, int width, int height);
/// The bytes of a JPEG file; the same pixels give the same bytes. std::runtime_error if memory is exhausted.
std::vector<std::uint8_t> encodeJpeg(const std::uint8_t* grey, int width, int height, int quality);
void writeJpeg(const std::string& path, const std::uint8_t* grey, int width, int height, int quality);

}  // namespace swiftlet
