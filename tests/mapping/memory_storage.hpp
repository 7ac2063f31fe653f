#pragma once
// What a file does for the map's blocks, in memory; it can be told to be full or unreadable.

#include <algorithm>
#include <cstring>
#include <vector>

#include "mapping/map/stored_blocks.hpp"

namespace swiftlet::testing {

struct MemoryStorage : BlockStorage {
  bool write(std::uint64_t offset, std::span<const std::byte> more) override {
    if (offset + more.size() > most) return false;
    bytes.resize(std::max<std::size_t>(bytes.size(), offset + more.size()));
    std::memcpy(bytes.data() + offset, more.data(), more.size());
    return true;
  }
  bool read(std::uint64_t offset, std::span<std::byte> out) override {
    if (!readable || offset + out.size() > bytes.size()) return false;
    std::memcpy(out.data(), bytes.data() + offset, out.size());
    return true;
  }
  std::vector<std::byte> bytes;
  std::size_t most = std::size_t{1} << 30U;
  bool readable = true;
};

}  // namespace swiftlet::testing
