#pragma once
// Encodes and decodes the bodies of ROS messages to and from the structures of drivers/bag/ros_messages.hpp,
// with a visitor over their fields.
//
// ROS 1: packed, little-endian; strings and arrays begin with a 32-bit length.
// ROS 2: XCDR version 1, plain: a header of four bytes, the second of which is the byte order; each number is
// aligned to its size, counted from the end of the header; a string's length includes its NUL. Both byte
// orders are read.
// Errors: false for a body that ends early or has another encoding. Every read is bounds-checked.
// Memory: that of the message; byte arrays are views into the body.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/ros_messages.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

template <typename T>
concept RosNumber = std::is_arithmetic_v<T>;

/// Reads the fields of one message from its bytes.
template <bool kIsRos1>
class MessageReader {
 public:
  static constexpr bool kRos1 = kIsRos1;

  explicit MessageReader(std::span<const std::uint8_t> body) : bytes_(body) {
    if constexpr (!kRos1) {
      constexpr std::size_t kHead = 4;
      const bool known = body.size() >= kHead && body[0] == 0 && body[1] <= 1;
      good_ = known;
      if (!known) return;
      swap_ = body[1] == 0;
      bytes_ = body.subspan(kHead);
    }
  }

  [[nodiscard]] bool good() const { return good_; }

  template <RosNumber T>
  void operator()(const char* /*name*/, T& value) {
    if constexpr (!kRos1) at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (!good_ || at_ > bytes_.size() || bytes_.size() - at_ < sizeof(T)) {
      good_ = false;
      return;
    }
    std::array<std::uint8_t, sizeof(T)> word;
    std::memcpy(word.data(), bytes_.data() + at_, sizeof(T));
    if (swap_) std::reverse(word.begin(), word.end());
    if constexpr (std::is_same_v<T, bool>) {
      value = word[0] != 0;
    } else {
      value = std::bit_cast<T>(word);
    }
    at_ += sizeof(T);
  }

  void operator()(const char* name, Stamp& stamp) {
    std::int32_t seconds = 0;
    std::uint32_t nanoseconds = 0;
    (*this)(name, seconds);
    (*this)(name, nanoseconds);
    // ROS 1 seconds are unsigned, up to the year 2106.
    const std::int64_t whole =
        kRos1 ? static_cast<std::int64_t>(static_cast<std::uint32_t>(seconds)) : seconds;
    stamp.ns = whole * rosmsg::kNsPerSecond + nanoseconds;
  }
  void operator()(const char* name, rosmsg::Byte& byte) { (*this)(name, byte.value); }
  void operator()(const char* name, rosmsg::Duration& duration) {
    (*this)(name, duration.seconds);
    (*this)(name, duration.nanoseconds);
  }
  void operator()(const char* /*name*/, std::span<const std::uint8_t>& bytes) { bytes = take(length()); }
  void operator()(const char* /*name*/, std::string& text) {
    const std::span<const std::uint8_t> bytes = take(length());
    text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if constexpr (!kRos1) {
      if (text.empty()) return;
      if (text.back() != '\0') good_ = false;
      text.pop_back();
    }
  }
  template <typename T, std::size_t kCount>
  void operator()(const char* name, std::array<T, kCount>& values) {
    for (T& value : values) (*this)(name, value);
  }
  template <typename T>
  void operator()(const char* name, std::vector<T>& values) {
    values.clear();
    // Every element takes at least one byte, so a wrong length stops at the end of the body.
    for (std::size_t left = length(); left > 0 && good_; --left) (*this)(name, values.emplace_back());
  }
  template <rosmsg::Message T>
  void operator()(const char* /*name*/, T& message) {
    T::fields(message, *this);
  }

 private:
  std::size_t length() {
    std::uint32_t count = 0;
    (*this)("", count);
    return good_ ? count : 0;
  }
  std::span<const std::uint8_t> take(std::size_t count) {
    if (!good_ || bytes_.size() - at_ < count) {
      good_ = false;
      return {};
    }
    const std::span<const std::uint8_t> taken = bytes_.subspan(at_, count);
    at_ += count;
    return taken;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool swap_ = false;
  bool good_ = true;
};

/// False if the body is not a complete message of this type. `Header` can be decoded from any message that
/// starts with one.
template <rosmsg::Message T>
[[nodiscard]] bool decode(std::span<const std::uint8_t> body, BagEncoding encoding, T& message) {
  const auto read = [&](auto reader) {
    reader("", message);
    return reader.good();
  };
  if (encoding == BagEncoding::kRos1) return read(MessageReader<true>(body));
  return encoding == BagEncoding::kCdr && read(MessageReader<false>(body));
}

template <bool kIsRos1>
class MessageWriter {
 public:
  static constexpr bool kRos1 = kIsRos1;

  explicit MessageWriter(std::vector<std::uint8_t>& body) : bytes_(body) {
    bytes_.clear();
    if constexpr (!kRos1) bytes_.insert(bytes_.end(), {0, 1, 0, 0});  // little-endian
  }

  template <RosNumber T>
  void operator()(const char* /*name*/, T value) {
    static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");
    // Alignment is counted from the end of the four-byte header.
    if constexpr (!kRos1) bytes_.resize(4 + (bytes_.size() - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T));
    const auto word = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
    bytes_.insert(bytes_.end(), word.begin(), word.end());
  }
  void operator()(const char* name, Stamp stamp) {
    std::int64_t seconds = stamp.ns / rosmsg::kNsPerSecond;
    if (stamp.ns % rosmsg::kNsPerSecond < 0) --seconds;
    (*this)(name, static_cast<std::uint32_t>(seconds));
    (*this)(name, static_cast<std::uint32_t>(stamp.ns - seconds * rosmsg::kNsPerSecond));
  }
  void operator()(const char* name, rosmsg::Byte byte) { (*this)(name, byte.value); }
  void operator()(const char* name, rosmsg::Duration duration) {
    (*this)(name, duration.seconds);
    (*this)(name, duration.nanoseconds);
  }
  void operator()(const char* name, std::span<const std::uint8_t> bytes) {
    (*this)(name, static_cast<std::uint32_t>(bytes.size()));
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void operator()(const char* name, const std::string& text) {
    (*this)(name, static_cast<std::uint32_t>(text.size() + (kRos1 ? 0 : 1)));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    if constexpr (!kRos1) bytes_.push_back(0);
  }
  template <typename T, std::size_t kCount>
  void operator()(const char* name, const std::array<T, kCount>& values) {
    for (const T& value : values) (*this)(name, value);
  }
  void operator()(const char* name, const std::vector<std::uint8_t>& bytes) {
    (*this)(name, std::span<const std::uint8_t>(bytes));
  }
  template <typename T>
  void operator()(const char* name, const std::vector<T>& values) {
    (*this)(name, static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) (*this)(name, value);
  }
  template <rosmsg::Message T>
  void operator()(const char* /*name*/, const T& message) {
    T::fields(message, *this);
  }

 private:
  std::vector<std::uint8_t>& bytes_;
};

template <rosmsg::Message T>
void encode(const T& message, BagEncoding encoding, std::vector<std::uint8_t>& body) {
  if (encoding == BagEncoding::kRos1) {
    MessageWriter<true>{body}("", message);
  } else {
    MessageWriter<false>{body}("", message);
  }
}

}  // namespace swiftlet
