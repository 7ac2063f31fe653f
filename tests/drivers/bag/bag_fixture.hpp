#pragma once
// Small bags, and how they are compared.

#include <catch2/catch.hpp>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/bag_writer.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {

/// A folder under the system's temporary one, removed at the end.
class BagFolder {
 public:
  BagFolder();
  ~BagFolder();
  BagFolder(const BagFolder&) = delete;
  BagFolder& operator=(const BagFolder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

struct PlainMessage {
  std::string topic;
  std::string type;
  std::int64_t time = 0;
  std::vector<std::uint8_t> body;
  bool operator==(const PlainMessage&) const = default;
};

/// Two topics of two types whose messages take turns, some of one time.
std::vector<PlainMessage> someMessages(int count, std::size_t bytes);
void write(BagWriter& writer, const std::vector<PlainMessage>& messages);
std::vector<PlainMessage> readBack(BagFile& bag);
std::vector<PlainMessage> readBack(const std::string& path);

void writeBytes(const std::string& path, const std::vector<std::uint8_t>& bytes);

/// Same as errorOf().
template <typename Call>
InputError refusalOf(const Call& call) {
  return errorOf(call);
}

}  // namespace swiftlet::test
