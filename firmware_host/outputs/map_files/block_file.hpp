#pragma once
// The map's blocks on disk while a run goes on: a file of the run folder without a name (it is unlinked as it
// is opened), so nothing is left behind.
//
// Host side, of the thread `map`, then of whoever writes the map. Errors: a file that cannot be made, or
// takes no more, refuses the block, which StoredBlocks counts; the flight goes on.

#include <string>

#include "mapping/map/stored_blocks.hpp"

namespace swiftlet {

class BlockFile : public BlockStorage {
 public:
  /// The file is made in `folder`, with the first block. Empty: no file, every block is refused.
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
