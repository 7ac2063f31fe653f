#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"

#include <zlib.h>

#include <array>
#include <cstdio>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

// ORBvoc.txt has 145 MB. A file that unpacks to more than this limit is not a vocabulary.
constexpr std::size_t kMaxText = std::size_t{1} << 30;

std::string unpacked(const std::string& name, std::string_view bytes) {
  z_stream stream{};
  constexpr int kGzipOnly = 16 + MAX_WBITS;
  if (inflateInit2(&stream, kGzipOnly) != Z_OK) throw InputError(name, 0, "", "cannot be unpacked", "");
  // zlib does not write to its input; its interface predates const.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string text;
  std::array<char, 1 << 16> part;
  int result = Z_OK;
  while (result == Z_OK && text.size() < kMaxText) {
    stream.next_out = reinterpret_cast<Bytef*>(part.data());
    stream.avail_out = static_cast<uInt>(part.size());
    result = inflate(&stream, Z_NO_FLUSH);
    text.append(part.data(), part.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (result != Z_STREAM_END) {
    throw InputError(name, 0, "", "damaged: it cannot be decompressed",
                     "Download the file again, or decompress it with gzip -d");
  }
  return text;
}

Vocabulary assembled(const std::string& name, const std::vector<VocabularyNode>& nodes) {
  Vocabulary vocabulary;
  if (const Status status = vocabulary.assemble(nodes); !status.ok()) {
    throw InputError(name, 0, "", status.what, "Give a complete vocabulary");
  }
  return vocabulary;
}

}  // namespace

Vocabulary readVocabularyBytes(const std::string& name, std::string_view bytes) {
  if (bytes.starts_with("\x1f\x8b")) {
    const std::string text = unpacked(name, bytes);
    if (text.starts_with("\x1f\x8b")) throw InputError(name, 0, "", "compressed twice", "Decompress it once");
    return readVocabularyBytes(name, text);
  }
  if (bytes.starts_with("SWPLACES")) {
    Vocabulary vocabulary;
    const Status status =
        vocabulary.load({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
    if (!status.ok())
      throw InputError(name, 0, "", status.what, "Create it again with `swiftlet vocabulary`");
    return vocabulary;
  }
  if (bytes.starts_with("%YAML") || bytes.substr(0, 256).find("vocabulary:") != std::string_view::npos) {
    return assembled(name, readVocabularyYaml(name, bytes));
  }
  return assembled(name, readVocabularyText(name, bytes));
}

Vocabulary readVocabulary(const std::string& path) {
  return readVocabularyBytes(path, readFile(path, "Give the file of a vocabulary"));
}

void writeVocabulary(const std::string& path, const Vocabulary& vocabulary) {
  const std::vector<std::uint8_t> bytes = vocabulary.compact();
  writeWholeFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace swiftlet
