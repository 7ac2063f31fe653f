#include "firmware_host/report/g2o_file.hpp"

#include <lzma.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "drivers/calibration/input_error.hpp"

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

std::string unpackXz(const std::string& name, std::string_view packed) {
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
    if (text.size() > kMaxG2oText) {
      throw InputError(name, 0, "", "unpacks to more than 1 GiB", "Is it a pose graph?");
    }
  }
  if (result != LZMA_STREAM_END) {
    throw InputError(name, 0, "", "not a whole xz file", "Was the copy cut short? Try xz -t");
  }
  return text;
}

/// A line number as InputError counts them.
int lineOf(const G2oMessage& message) {
  constexpr std::size_t kLargest = std::numeric_limits<int>::max();
  return static_cast<int>(std::min(message.line, kLargest));
}

}  // namespace

G2oFile readG2oBytes(const std::string& name, std::string_view bytes) {
  std::string unpacked;
  if (bytes.starts_with(kXzMagic)) {
    unpacked = unpackXz(name, bytes);
    bytes = unpacked;
  }
  G2oFile file;
  G2oMessage fault;
  if (!readG2o(bytes, file.graph, file.report, fault)) {
    throw InputError(name, lineOf(fault), fault.field, fault.text, fault.remedy);
  }
  return file;
}

G2oFile readG2oFile(const std::string& path) {
  if (std::filesystem::is_directory(path)) {
    throw InputError(path, 0, "", "is a folder", "Give a .g2o or .g2o.xz file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, 0, "", std::string("cannot be read: ") + std::strerror(errno), "");
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (bytes.size() > kMaxG2oText) {
    throw InputError(path, 0, "", "is larger than 1 GiB", "Is it a pose graph?");
  }
  return readG2oBytes(path, bytes);
}

void writeG2oFile(const std::string& path, const G2oGraph& graph) {
  const std::string text = writeG2o(graph);
  const std::string part = path + ".part";
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(part, path, error);
  if (!file || error) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw InputError(path, 0, "", "cannot be written",
                     "Is the folder there and writable, the disk not full?");
  }
}

std::string warningText(const std::string& name, const G2oMessage& warning) {
  return InputError(name, lineOf(warning), warning.field, warning.text, warning.remedy).what();
}

}  // namespace swiftlet
