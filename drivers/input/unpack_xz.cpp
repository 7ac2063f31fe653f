#include "drivers/input/unpack_xz.hpp"

#include <lzma.h>

#include <array>
#include <cstdint>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::string_view kXzMagic(
    "\xFD"
    "7zXZ\0",
    6);
constexpr std::uint64_t kXzMemory = std::uint64_t{256} << 20U;  // bytes; xz -9 needs 65 MiB

class XzDecoder {
 public:
  explicit XzDecoder(const std::string& name) {
    if (lzma_stream_decoder(&stream_, kXzMemory, LZMA_CONCATENATED) != LZMA_OK) {
      throw InputError(name, 0, "", "no memory for the xz decoder", "Unpack the file with xz -d");
    }
  }
  ~XzDecoder() { lzma_end(&stream_); }
  XzDecoder(const XzDecoder&) = delete;
  XzDecoder& operator=(const XzDecoder&) = delete;
  lzma_stream& stream() { return stream_; }

 private:
  lzma_stream stream_ = LZMA_STREAM_INIT;
};

}  // namespace

bool isXz(std::string_view bytes) { return bytes.starts_with(kXzMagic); }

std::string unpackXz(const std::string& name, std::string_view packed, std::size_t most) {
  XzDecoder decoder(name);
  lzma_stream& stream = decoder.stream();
  std::string text;
  std::array<char, 1U << 16U> buffer{};
  stream.next_in = reinterpret_cast<const std::uint8_t*>(packed.data());
  stream.avail_in = packed.size();
  lzma_ret result = LZMA_OK;
  while (result == LZMA_OK) {
    stream.next_out = reinterpret_cast<std::uint8_t*>(buffer.data());
    stream.avail_out = buffer.size();
    result = lzma_code(&stream, LZMA_FINISH);
    text.append(buffer.data(), buffer.size() - stream.avail_out);
    if (text.size() > most) {
      throw InputError(name, 0, "", "unpacks to more than " + std::to_string(most >> 20U) + " MiB",
                       "Check that this is the right file");
    }
  }
  if (result != LZMA_STREAM_END) {
    throw InputError(name, 0, "", "not a complete xz file", "The copy may be truncated: check it with xz -t");
  }
  return text;
}

}  // namespace swiftlet
