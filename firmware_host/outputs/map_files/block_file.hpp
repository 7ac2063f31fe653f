#pragma once
// The map's blocks on disk during a run. The file in the run folder is unlinked right after it is opened, so
// nothing is left behind.
//
// Host side; used by the thread `map`, then by the writer of the map. Errors: if the file cannot be created
// or is full, the block is refused and counted by StoredBlocks; the flight continues.

#include <string>

#include "mapping/map/stored_blocks.hpp"

namespace swiftlet {

class BlockFile : public BlockStorage {
 public:
  /// The file is created in `folder` with the first block. Empty: no file, every block is refused.
  explicit BlockFile(std::string folder) : folder_(std::move(folder)) {}
  ~BlockFile() override;
  BlockFile(const BlockFile&) = delete;
  BlockFile& operator=(const BlockFile&) = delete;

  bool write(std::uint64_t offset, std::span<const std::byte> bytes) override;
  bool read(std::uint64_t offset, std::span<std::byte> bytes) override;

 private:
  bool open();

  std::string folder_;
  int file_ = -1;
  bool failed_ = false;
};

}  // namespace swiftlet
