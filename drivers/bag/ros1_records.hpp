#pragma once
// Records of ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0). A record is a header and data, each
// behind its length of four bytes; a header is a list of fields `name=value`, each behind its length too.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/device/byte_fields.hpp"

namespace swiftlet::ros1 {

using Bytes = std::span<const std::uint8_t>;

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
constexpr std::size_t kBagRecord = 4096;  // bytes of the first record without its two lengths
constexpr std::uint32_t kIndexVersion = 1;

enum class Op : std::uint8_t {
  kMessage = 2,
  kBag = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

inline std::string_view textOf(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The value of a field; none if it is missing or a field before it extends past the header.
inline std::optional<Bytes> field(Bytes header, std::string_view name) {
  LittleFieldReader reader(header);
  while (reader.left() > 0) {
    const Bytes bytes = reader.bytes(reader.u32());
    const std::string_view text = textOf(bytes);
    if (text.size() > name.size() && text[name.size()] == '=' && text.starts_with(name)) {
      return bytes.subspan(name.size() + 1);
    }
  }
  return std::nullopt;
}

/// The value of a field of four bytes; none also if its length differs.
inline std::optional<std::uint32_t> number(Bytes header, std::string_view name) {
  const std::optional<Bytes> value = field(header, name);
  if (!value || value->size() != sizeof(std::uint32_t)) return std::nullopt;
  return LittleFieldReader(*value).u32();
}

/// A record without its data.
struct Head {
  Op op{};  ///< Op{}: this is no record
  Bytes header;
  std::uint32_t length = 0;  ///< of the data
  std::size_t size = 0;      ///< bytes before the data
};

inline Head headOf(Bytes bytes) {
  LittleFieldReader reader(bytes);
  Head head;
  head.header = reader.bytes(reader.u32());
  head.length = reader.u32();
  head.size = bytes.size() - reader.left();
  const std::optional<Bytes> op = field(head.header, "op");
  if (reader.ok() && op && op->size() == 1) head.op = static_cast<Op>(op->front());
  return head;
}

}  // namespace swiftlet::ros1
