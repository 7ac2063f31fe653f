#include "drivers/bag/sqlite_bag.hpp"

#include <fmt/format.h>

#include <map>
#include <optional>

#include "drivers/bag/file_bytes.hpp"
#include "drivers/bag/sqlite_database.hpp"
#include "drivers/bag/unpack.hpp"
#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kMostMessage = std::size_t{1} << 30U;  // bytes; SQLite's own limit of a blob

constexpr const char* kDamaged =
    "The file is damaged: copy it again, or recover the intact part with `sqlite3 FILE .recover | sqlite3 "
    "NEW`";

class SqliteBag final : public BagFile {
 public:
  SqliteBag(const std::string& path, const std::string& name)
      : BagFile(name), database_(path, name, SqliteDatabase::Mode::kRead) {
    checkPages(path);
    for (const char* table : {"topics", "messages"}) {
      if (database_.hasTable(table)) continue;
      throw InputError(
          path_, 0, std::string("table ") + table, "is missing",
          "Check that it is a rosbag2 bag. Its recorder may have been killed before the first message");
    }
    readTopics();
    readEntries();
    body_.emplace(database_.prepare("SELECT data FROM messages WHERE id = ?"));
  }

  std::span<const std::uint8_t> read(const BagEntry& entry) override {
    const auto row = static_cast<std::int64_t>(entry.at);
    body_->reset();
    body_->bind(1, row);
    if (!body_->step("messages, row", row)) failRow(row, "no longer exists");
    if (!body_->isBlob(0)) failRow(row, "`data` is not a blob");
    const std::span<const std::uint8_t> body = body_->blob(0);
    if (!isZstd(body)) return body;
    if (!unpackZstd(body, kMostMessage, unpacked_)) failRow(row, "its zstd data is damaged");
    return unpacked_;
  }

 private:
  [[noreturn]] void failRow(std::int64_t row, const char* what) const {
    throw InputError(path_, 0, fmt::format("messages, row {}", row), what,
                     "The file is damaged: copy it again, or recover the intact part with `sqlite3 FILE "
                     ".recover | sqlite3 NEW`");
  }

  /// Detects a cut file: SQLite itself would fill up an incomplete last page with zeros.
  void checkPages(const std::string& path) const {
    constexpr std::size_t kPageSizeAt = 16;  // of the file's header; big-endian, 1 stands for 65536
    FileBytes file(path, path_);
    BigFieldReader reader(file.at(kPageSizeAt, sizeof(std::uint16_t)));
    const std::uint16_t stated = reader.u16();
    const std::uint64_t page = stated == 1 ? 65536 : stated;
    if (page != 0 && file.size() % page == 0) return;
    throw InputError(path_, 0, fmt::format("byte {}", file.size()), "the file is truncated within a page",
                     kDamaged);
  }

  void readTopics() {
    std::map<std::string, std::string, std::less<>> definitions;
    if (database_.hasTable("message_definitions")) {
      SqliteStatement rows =
          database_.prepare("SELECT topic_type, encoded_message_definition FROM message_definitions");
      for (std::int64_t row = 1; rows.step("message_definitions, row", row); ++row) {
        definitions.emplace(rows.text(0), rows.text(1));
      }
    }
    SqliteStatement rows = database_.prepare("SELECT id, name, type, serialization_format FROM topics");
    for (std::int64_t row = 1; rows.step("topics, row", row); ++row) {
      const auto definition = definitions.find(rows.text(2));
      const BagEncoding encoding = rows.text(3) == "cdr" ? BagEncoding::kCdr : BagEncoding::kOther;
      topic_of_[rows.integer(0)] =
          topicOf(rows.text(1), rows.text(2), encoding,
                  definition == definitions.end() ? std::string_view{} : definition->second);
    }
  }

  void readEntries() {
    SqliteStatement rows = database_.prepare("SELECT id, topic_id, timestamp FROM messages ORDER BY id");
    for (std::int64_t row = 1; rows.step("messages, row", row); ++row) {
      const auto topic = topic_of_.find(rows.integer(1));
      if (topic == topic_of_.end()) failRow(rows.integer(0), "its topic is not in the table `topics`");
      entries_.push_back(
          {Stamp{rows.integer(2)}, topic->second, 0, static_cast<std::uint64_t>(rows.integer(0))});
    }
    orderEntries();
  }

  SqliteDatabase database_;
  std::map<std::int64_t, std::uint32_t> topic_of_;
  std::optional<SqliteStatement> body_;
  std::vector<std::uint8_t> unpacked_;
};

}  // namespace

std::unique_ptr<BagFile> openSqliteBag(const std::string& path, const std::string& name) {
  return std::make_unique<SqliteBag>(path, name);
}

}  // namespace swiftlet
