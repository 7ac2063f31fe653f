#include "drivers/bag/chunked_bag.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/bag/mcap_records.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {

void ChunkedBag::fail(std::uint64_t at, const std::string& what) const {
  throw InputError(
      path_, 0, fmt::format("byte {}", at), what,
      fmt::format("The file is damaged: copy it again, or recover the intact part with `{}`", tool_));
}

void ChunkedBag::beginChunk(const Chunk& chunk) {
  if (const std::uint64_t most = std::max(chunk.packed, chunk.unpacked); most > kMostUnpacked) {
    throw InputError(path_, 0, fmt::format("byte {}", chunk.record),
                     fmt::format("a chunk of {} bytes is too large", most),
                     "Copy the file again if it is damaged, else write it with chunks of a few MiB");
  }
  before_chunk_ = entries_.size();
  chunk_open_ = true;
  chunks_.push_back(chunk);
}

void ChunkedBag::closeChunk() {
  if (!chunk_open_) return;
  if (entries_.size() == before_chunk_) scanChunk(newestChunk(), true);
  chunk_open_ = false;
}

void ChunkedBag::endEarly(std::uint64_t at) {
  // Some indexes of the newest chunk may be missing: read its records instead. After a power cut its end may
  // be zeros; then none of it is used.
  if (chunk_open_) {
    entries_.resize(before_chunk_);
    try {
      scanChunk(newestChunk(), true);
    } catch (const InputError&) {
      entries_.resize(before_chunk_);
      at = chunks_.back().record;
    }
  }
  warnings_.push_back(fmt::format(
      "{}: not closed by its recorder, or truncated: {} messages up to byte {} of {} are intact and are read",
      path_, entries_.size(), at, file_.size()));
}

std::span<const std::uint8_t> ChunkedBag::unpackedChunk(std::uint32_t index) {
  ++uses_;
  Unpacked* oldest = kept_.data();
  for (Unpacked& kept : kept_) {
    if (kept.chunk == index) {
      kept.used = uses_;
      return kept.bytes;
    }
    if (kept.used < oldest->used) oldest = &kept;
  }
  const Chunk& chunk = chunks_[index];
  oldest->chunk = kNoChunk;
  const bool packed = chunk.packing != Packing::kNone;
  std::vector<std::uint8_t>& read = packed ? packed_ : oldest->bytes;
  file_.read(chunk.data, static_cast<std::size_t>(chunk.packed), read);
  if (read.size() != chunk.packed) fail(chunk.record, "a chunk is truncated");
  if (packed ? !unpack(chunk.packing, packed_, static_cast<std::size_t>(chunk.unpacked), oldest->bytes)
             : chunk.packed != chunk.unpacked) {
    fail(chunk.record, "a chunk cannot be decompressed");
  }
  if (chunk.crc != 0 && mcap::crcOf(0, oldest->bytes) != chunk.crc) {
    fail(chunk.record, "a chunk's checksum is wrong");
  }
  oldest->chunk = index;
  oldest->used = uses_;
  return oldest->bytes;
}

}  // namespace swiftlet
