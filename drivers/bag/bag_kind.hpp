#pragma once
// Detects the kind of a bag from its first bytes.

#include <cstdint>
#include <string>
#include <string_view>

namespace swiftlet {

enum class BagKind : std::uint8_t { kNone, kRos1, kMcap, kSqlite, kZstd };

[[nodiscard]] BagKind bagKindOf(const std::string& path);
[[nodiscard]] BagKind bagKindOf(std::string_view begin);

}  // namespace swiftlet
