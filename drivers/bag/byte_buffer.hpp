#pragma once
// Little-endian numbers and bytes, one after the other; grows. For the writers of bags.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace swiftlet {

class ByteBuffer {
 public:
  ByteBuffer& u8(std::uint8_t value) { return put(value); }
  ByteBuffer& u16(std::uint16_t value) { return put(value); }
  ByteBuffer& u32(std::uint32_t value) { return put(value); }
  ByteBuffer& u64(std::uint64_t value) { return put(value); }
  ByteBuffer& copy(std::span<const std::uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  /// Replaces eight bytes that are there.
  void setU64(std::size_t at, std::uint64_t value) { std::memcpy(bytes_.data() + at, &value, sizeof(value)); }
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  template <typename T>
  ByteBuffer& put(T value) {
    static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");
    return copy(std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value));
  }

  std::vector<std::uint8_t> bytes_;
};

}  // namespace swiftlet
