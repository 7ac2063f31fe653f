#include "firmware_host/lab/budget/xml_text.hpp"

#include <cstddef>
#include <cstdint>

namespace swiftlet {
namespace {

/// Length of the UTF-8 character at the start of `text`; 0 if it is invalid or not allowed in XML.
std::size_t characterBytes(std::string_view text) {
  const auto byte = [&text](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t bytes = first >> 5U == 0x6 ? 2 : first >> 4U == 0xE ? 3 : first >> 3U == 0x1E ? 4 : 0;
  if (bytes == 0 || text.size() < bytes) return 0;
  std::uint32_t code = first & (0x7FU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if (byte(i) >> 6U != 0x2) return 0;
    code = code << 6U | (byte(i) & 0x3FU);
  }
  // Refuses overlong encodings, halves of surrogate pairs, the two non-characters, and codes beyond Unicode.
  constexpr std::uint32_t kLeast[] = {0x80, 0x800, 0x10000};
  const bool allowed = code >= kLeast[bytes - 2] && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF) &&
                       code != 0xFFFE && code != 0xFFFF;
  return allowed ? bytes : 0;
}

std::string asciiText(char character, XmlPlace place) {
  switch (character) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\n':
      return place == XmlPlace::kAttribute ? "&#10;" : "\n";
    case '\t':
      return place == XmlPlace::kAttribute ? "&#9;" : "\t";
    case '\r':
      return "&#13;";
    default:
      break;
  }
  constexpr char kFirstPrinted = 0x20;
  return character < kFirstPrinted ? "?" : std::string(1, character);
}

}  // namespace

std::string xmlText(std::string_view text, XmlPlace place) {
  std::string out;
  while (!text.empty()) {
    const std::size_t bytes = characterBytes(text);
    if (bytes == 1) {
      out += asciiText(text[0], place);
    } else if (bytes == 0) {
      out += '?';
    } else {
      out += text.substr(0, bytes);
    }
    text.remove_prefix(bytes == 0 ? 1 : bytes);
  }
  return out;
}

}  // namespace swiftlet
