#pragma once
// The decoders of serial links as fuzz targets: any bytes, read in several ways.

#include <string_view>

namespace swiftlet::fuzz {

void vectornavStream(std::string_view text);
void xsensStream(std::string_view text);
void mipStream(std::string_view text);
void mavlinkStream(std::string_view text);
void bridgeStream(std::string_view text);

}  // namespace swiftlet::fuzz
