#pragma once
// Reads and writes the numbers of a message or a file field by field, in either byte order, on any machine.
//
// Safe for any length: reading past the end gives zeros, writing past it writes nothing, and ok() is false
// afterwards. No allocation; the bytes belong to the caller.

#include <Eigen/Core>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace swiftlet {

template <std::endian kOrder>
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint8_t u8() { return static_cast<std::uint8_t>(unsignedOf<1>()); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(unsignedOf<2>()); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(unsignedOf<4>()); }
  std::uint64_t u64() { return unsignedOf<8>(); }
  std::int16_t i16() { return static_cast<std::int16_t>(u16()); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  std::int64_t i64() { return static_cast<std::int64_t>(u64()); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(u64()); }
  /// Three f32, converted exactly.
  Eigen::Vector3d vectorF32() {
    const double x = f32(), y = f32(), z = f32();
    return {x, y, z};
  }
  void skip(std::size_t count) {
    if (count > left()) {
      failed_ = true;
      count = left();
    }
    at_ += count;
  }

  /// The next `count` bytes; empty if fewer are left.
  std::span<const std::uint8_t> bytes(std::size_t count) {
    const std::span<const std::uint8_t> taken = count > left() ? bytes_.last(0) : bytes_.subspan(at_, count);
    skip(count);
    return taken;
  }

  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
  /// False after reading past the end.
  [[nodiscard]] bool ok() const { return !failed_; }

 private:
  template <std::size_t kSize>
  std::uint64_t unsignedOf() {
    if (kSize > left()) {
      failed_ = true;
      at_ = bytes_.size();
      return 0;
    }
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const std::size_t place = kOrder == std::endian::little ? i : kSize - 1 - i;
      value |= static_cast<std::uint64_t>(bytes_[at_ + i]) << (8 * place);
    }
    at_ += kSize;
    return value;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

template <std::endian kOrder>
class FieldWriter {
 public:
  explicit FieldWriter(std::span<std::uint8_t> bytes) : bytes_(bytes) {}

  void u8(std::uint8_t value) { put<1>(value); }
  void u16(std::uint16_t value) { put<2>(value); }
  void u32(std::uint32_t value) { put<4>(value); }
  void u64(std::uint64_t value) { put<8>(value); }
  void i32(std::int32_t value) { u32(static_cast<std::uint32_t>(value)); }
  void i64(std::int64_t value) { u64(static_cast<std::uint64_t>(value)); }
  void f32(float value) { u32(std::bit_cast<std::uint32_t>(value)); }
  void f64(double value) { u64(std::bit_cast<std::uint64_t>(value)); }
  /// Three f32, rounded to nearest.
  void vectorF32(const Eigen::Vector3d& value) {
    for (int i = 0; i < 3; ++i) f32(static_cast<float>(value[i]));
  }
  void copy(std::span<const std::uint8_t> bytes) {
    const std::span<std::uint8_t> to = take(bytes.size());
    if (!to.empty()) std::memcpy(to.data(), bytes.data(), to.size());
  }
  void zeros(std::size_t count) {
    for (std::uint8_t& byte : take(count)) byte = 0;
  }

  /// The bytes written so far.
  [[nodiscard]] std::span<std::uint8_t> written() const { return bytes_.first(at_); }
  /// False if a field did not fit.
  [[nodiscard]] bool ok() const { return !failed_; }

 private:
  /// The next `count` bytes; empty if they do not fit.
  std::span<std::uint8_t> take(std::size_t count) {
    if (count > bytes_.size() - at_) {
      failed_ = true;
      return {};
    }
    at_ += count;
    return bytes_.subspan(at_ - count, count);
  }
  template <std::size_t kSize>
  void put(std::uint64_t value) {
    if (kSize > bytes_.size() - at_) {
      failed_ = true;
      return;
    }
    for (std::size_t i = 0; i < kSize; ++i) {
      const std::size_t place = kOrder == std::endian::little ? i : kSize - 1 - i;
      bytes_[at_ + i] = static_cast<std::uint8_t>(value >> (8 * place));
    }
    at_ += kSize;
  }

  std::span<std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

using LittleFieldReader = FieldReader<std::endian::little>;
using LittleFieldWriter = FieldWriter<std::endian::little>;
using BigFieldReader = FieldReader<std::endian::big>;
using BigFieldWriter = FieldWriter<std::endian::big>;

}  // namespace swiftlet
