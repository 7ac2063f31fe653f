#pragma once
// What the readers of MCAP files and ROS 1 bags share: messages lie in chunks, compressed or not, and indexes
// of the messages follow each chunk. A chunk with an index is decompressed only when one of its messages is
// read.

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/file_bytes.hpp"
#include "drivers/bag/unpack.hpp"

namespace swiftlet {

class ChunkedBag : public BagFile {
 protected:
  struct Chunk {
    std::uint64_t record = 0;  ///< byte where its record begins
    std::uint64_t data = 0;    ///< byte where its compressed records begin
    std::uint64_t packed = 0;
    std::uint64_t unpacked = 0;
    std::uint32_t crc = 0;  ///< 0: no checksum
    Packing packing = Packing::kNone;
  };
  /// A message's part if it is outside of chunks.
  static constexpr std::uint32_t kNoChunk = std::numeric_limits<std::uint32_t>::max();

  /// `name` names the file in messages; `tool` recovers the intact part of a damaged one.
  ChunkedBag(const std::string& path, const std::string& name, std::string tool)
      : BagFile(name), file_(path, name), tool_(std::move(tool)) {}

  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const;
  /// Its indexes may follow. InputError if it is too large.
  void beginChunk(const Chunk& chunk);
  [[nodiscard]] bool chunkIsOpen() const { return chunk_open_; }
  [[nodiscard]] std::uint32_t newestChunk() const { return static_cast<std::uint32_t>(chunks_.size() - 1); }
  /// No further index follows: without any, the records are read.
  void closeChunk();
  /// The recorder did not close the file, or it is truncated: all before byte `at` is read.
  void endEarly(std::uint64_t at);
  /// Valid until the next call.
  std::span<const std::uint8_t> unpackedChunk(std::uint32_t index);
  /// Takes what a chunk's records define and, on request, its messages.
  virtual void scanChunk(std::uint32_t chunk, bool messages) = 0;

  FileBytes file_;
  std::vector<Chunk> chunks_;
  std::vector<std::uint8_t> packed_;  ///< for reading, also outside of chunks

 private:
  static constexpr std::size_t kChunksKept = 4;

  struct Unpacked {
    std::uint32_t chunk = kNoChunk;
    std::uint64_t used = 0;  ///< number of the last use
    std::vector<std::uint8_t> bytes;
  };

  std::string tool_;
  std::size_t before_chunk_ = 0;  ///< number of entries before those of the newest chunk
  bool chunk_open_ = false;       ///< further indexes of the newest chunk may follow
  std::array<Unpacked, kChunksKept> kept_;
  std::uint64_t uses_ = 0;
};

}  // namespace swiftlet
