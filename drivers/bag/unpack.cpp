#include "drivers/bag/unpack.hpp"

#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kFirstRoom = std::size_t{1} << 20U;  // bytes; size of a usual chunk
// Images hardly compress: the fastest level reduces raw grey to two thirds at about 400 MB/s.
constexpr int kZstdLevel = 1;

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

using Zstd = std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)>;
Zstd makeZstd() { return {ZSTD_createDStream(), &ZSTD_freeDStream}; }

/// `step(to, room, written, done)` unpacks a piece; it returns false on damage and sets `done` at the end.
template <typename Step>
bool unpackGrowing(std::size_t most, std::vector<std::uint8_t>& out, Step&& step) {
  std::size_t size = 0;
  for (bool done = false; !done;) {
    // One byte more than allowed, to detect output that is too long.
    if (size == out.size()) out.resize(std::min(std::max(2 * size, kFirstRoom), most + 1));
    std::size_t written = 0;
    if (!step(out.data() + size, out.size() - size, written, done)) return false;
    size += written;
    if (size > most) return false;
  }
  out.resize(size);
  return true;
}

bool unpackLz4(std::span<const std::uint8_t> packed, std::size_t most, std::vector<std::uint8_t>& out) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) return false;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, &LZ4F_freeDecompressionContext);
  std::size_t at = 0;
  return unpackGrowing(most, out, [&](std::uint8_t* to, std::size_t room, std::size_t& written, bool& done) {
    std::size_t taken = packed.size() - at;
    written = room;
    const std::size_t left =
        LZ4F_decompress(context.get(), to, &written, packed.data() + at, &taken, nullptr);
    if (LZ4F_isError(left) != 0) return false;
    at += taken;
    done = left == 0 && at == packed.size();
    return done || written > 0 || taken > 0;
  });
}

bool unpackBz2(std::span<const std::uint8_t> packed, std::size_t most, std::vector<std::uint8_t>& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, &BZ2_bzDecompressEnd);
  // The library does not write to its input, though it takes it as writable.
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
  stream.avail_in = static_cast<unsigned>(packed.size());
  return unpackGrowing(most, out, [&](std::uint8_t* to, std::size_t room, std::size_t& written, bool& done) {
    const unsigned before = stream.avail_in;
    stream.next_out = reinterpret_cast<char*>(to);
    stream.avail_out = static_cast<unsigned>(room);
    const int result = BZ2_bzDecompress(&stream);
    if (result != BZ_OK && result != BZ_STREAM_END) return false;
    written = room - stream.avail_out;
    done = result == BZ_STREAM_END && stream.avail_in == 0;
    return done || (result == BZ_OK && (written > 0 || stream.avail_in < before));
  });
}

[[noreturn]] void failToUnpack(const std::string& file, std::size_t at, const char* what) {
  throw InputError(file, 0, fmt::format("byte {}", at), what,
                   "Copy it again, or decompress it with `zstd -d` and give the decompressed bag");
}

void unpackFile(const std::string& packed, const std::string& to) {
  const File in(std::fopen(packed.c_str(), "rbe"));
  const File out(std::fopen(to.c_str(), "wbe"));
  if (!in || !out) {
    throw InputError(packed, 0, "", "cannot be decompressed to " + to,
                     "Set TMPDIR to a folder with enough free space");
  }
  const Zstd stream = makeZstd();
  std::vector<std::uint8_t> from(ZSTD_DStreamInSize());
  std::vector<std::uint8_t> room(ZSTD_DStreamOutSize());
  std::size_t read = 0;
  std::size_t left = 1;
  while (const std::size_t got = std::fread(from.data(), 1, from.size(), in.get())) {
    ZSTD_inBuffer source = {from.data(), got, 0};
    bool full = true;
    while (source.pos < source.size || full) {
      ZSTD_outBuffer target = {room.data(), room.size(), 0};
      left = ZSTD_decompressStream(stream.get(), &target, &source);
      if (ZSTD_isError(left) != 0) failToUnpack(packed, read + source.pos, "its zstd data is damaged");
      if (std::fwrite(room.data(), 1, target.pos, out.get()) != target.pos) {
        throw InputError(packed, 0, "", "not enough space to decompress it to " + to,
                         "Set TMPDIR to a folder with space for the decompressed bag");
      }
      // A frame that has ended is all out, even if it fills the room.
      full = left != 0 && target.pos == target.size;
    }
    read += got;
  }
  if (left != 0) failToUnpack(packed, read, "its zstd data is truncated");
  if (std::fflush(out.get()) != 0) failToUnpack(packed, read, "not enough space to decompress it");
}

}  // namespace

bool unpackZstd(std::span<const std::uint8_t> packed, std::size_t most, std::vector<std::uint8_t>& out) {
  const Zstd stream = makeZstd();
  ZSTD_inBuffer in = {packed.data(), packed.size(), 0};
  std::size_t left = 1;  // bytes of the frame still expected; 0 at its end
  return unpackGrowing(most, out, [&](std::uint8_t* to, std::size_t room, std::size_t& written, bool& done) {
    ZSTD_outBuffer target = {to, room, 0};
    const std::size_t before = in.pos;
    left = ZSTD_decompressStream(stream.get(), &target, &in);
    if (ZSTD_isError(left) != 0) return false;
    written = target.pos;
    done = left == 0 && in.pos == in.size;
    return done || written > 0 || in.pos > before;
  });
}

bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::size_t size,
            std::vector<std::uint8_t>& out) {
  switch (packing) {
    case Packing::kNone:
      return false;
    case Packing::kLz4:
      if (!unpackLz4(packed, size, out)) return false;
      break;
    case Packing::kZstd:
      if (!unpackZstd(packed, size, out)) return false;
      break;
    case Packing::kBz2:
      if (!unpackBz2(packed, size, out)) return false;
      break;
  }
  return out.size() == size;
}

bool isZstd(std::span<const std::uint8_t> bytes) {
  constexpr std::uint8_t kMagic[] = {0x28, 0xB5, 0x2F, 0xFD};
  return bytes.size() >= sizeof(kMagic) && std::equal(std::begin(kMagic), std::end(kMagic), bytes.begin());
}

std::vector<std::uint8_t> packZstd(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> packed(ZSTD_compressBound(bytes.size()));
  const std::size_t size =
      ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0) throw std::runtime_error("zstd: out of memory");
  packed.resize(size);
  return packed;
}

std::string unpackedBegin(const std::string& packed, std::size_t most) {
  // Enough for the frame's header and first block.
  std::string from(ZSTD_DStreamInSize(), '\0');
  std::ifstream file(packed, std::ios::binary);
  file.read(from.data(), static_cast<std::streamsize>(from.size()));
  std::string begin(most, '\0');
  const Zstd stream = makeZstd();
  ZSTD_inBuffer source = {from.data(), static_cast<std::size_t>(file.gcount()), 0};
  ZSTD_outBuffer target = {begin.data(), begin.size(), 0};
  while (target.pos < target.size && source.pos < source.size) {
    if (ZSTD_isError(ZSTD_decompressStream(stream.get(), &target, &source)) != 0) break;
  }
  begin.resize(target.pos);
  return begin;
}

UnpackedFile::UnpackedFile(const std::string& packed) {
  std::string name = (std::filesystem::temp_directory_path() / "swiftlet_bag_XXXXXX").string();
  const int made = ::mkstemp(name.data());
  if (made < 0) {
    throw InputError(packed, 0, "", "cannot create a file for it in " + name,
                     "Set TMPDIR to a writable folder");
  }
  ::close(made);
  path_ = name;
  try {
    unpackFile(packed, path_);
  } catch (...) {
    ::unlink(path_.c_str());
    throw;
  }
}

UnpackedFile::~UnpackedFile() { ::unlink(path_.c_str()); }

}  // namespace swiftlet
