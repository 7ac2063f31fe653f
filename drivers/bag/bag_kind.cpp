#include "drivers/bag/bag_kind.hpp"

#include <array>
#include <fstream>
#include <string_view>
#include <utility>

namespace swiftlet {

BagKind bagKindOf(std::string_view begin) {
  using std::string_view_literals::operator""sv;
  constexpr std::array kBeginnings = {
      std::pair{"#ROSBAG V2.0\n"sv, BagKind::kRos1}, std::pair{"\x89MCAP0\r\n"sv, BagKind::kMcap},
      std::pair{"SQLite format 3\0"sv, BagKind::kSqlite}, std::pair{"\x28\xB5\x2F\xFD"sv, BagKind::kZstd}};
  for (const auto& [text, kind] : kBeginnings) {
    if (begin.starts_with(text)) return kind;
  }
  return BagKind::kNone;
}

BagKind bagKindOf(const std::string& path) {
  std::array<char, 16> head{};
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), head.size());
  return bagKindOf(std::string_view(head.data(), static_cast<std::size_t>(file.gcount())));
}

}  // namespace swiftlet
