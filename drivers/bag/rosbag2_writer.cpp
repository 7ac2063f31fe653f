#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <vector>

#include "drivers/bag/bag_writer.hpp"
#include "drivers/bag/qos_text.hpp"
#include "drivers/bag/sqlite_database.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// Writes metadata.yaml version 5 and database schema 3 like Humble; all later releases read both.
class Rosbag2Writer final : public BagWriter {
 public:
  Rosbag2Writer(const std::string& folder, const std::string& name)
      : folder_(folder),
        file_(name + "_0.db3"),
        database_((fs::create_directories(folder), fs::path(folder) / file_).string(),
                  (fs::path(folder) / file_).string(), SqliteDatabase::Mode::kCreate) {
    // The caller renames the complete file, so a journal is not needed.
    database_.execute(
        "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN;"
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT "
        "NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT "
        "NULL, "
        "data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        "INSERT INTO schema(schema_version, ros_distro) VALUES (3, 'humble');");
    insert_.emplace(database_.prepare("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)"));
  }

  [[nodiscard]] BagEncoding encoding() const override { return BagEncoding::kCdr; }

  std::uint32_t addTopic(const BagWriterTopic& topic) override {
    topics_.push_back({topic, 0});
    const std::string type = ros2Type(topic.type);
    const std::string qos = qosText(topic.latched);
    SqliteStatement insert = database_.prepare(
        "INSERT INTO topics(id, name, type, serialization_format, offered_qos_profiles) VALUES (?, ?, ?, "
        "'cdr', ?)");
    insert.bind(1, static_cast<std::int64_t>(topics_.size()));
    insert.bind(2, std::string_view(topic.name));
    insert.bind(3, std::string_view(type));
    insert.bind(4, std::string_view(qos));
    insert.step("topics, row", static_cast<std::int64_t>(topics_.size()));
    return static_cast<std::uint32_t>(topics_.size() - 1);
  }

  void write(std::uint32_t topic, Stamp log_time, std::uint32_t /*sequence*/,
             std::span<const std::uint8_t> body) override {
    insert_->bind(1, static_cast<std::int64_t>(topic) + 1);
    insert_->bind(2, log_time.ns);
    insert_->bind(3, body);
    insert_->step("messages, row", static_cast<std::int64_t>(messages_ + 1));
    insert_->reset();
    ++topics_[topic].messages;
    ++messages_;
    first_ = std::min(first_, log_time.ns);
    last_ = std::max(last_, log_time.ns);
  }

  void finish() override {
    insert_.reset();
    database_.execute("COMMIT;");
    database_.close();
    const fs::path metadata = folder_ / "metadata.yaml";
    std::ofstream file(metadata, std::ios::binary);
    file << metadataText();
    file.close();
    if (!file) {
      throw InputError(metadata.string(), 0, "", "cannot be written", "Check that the disk is not full");
    }
  }

 private:
  struct Topic {
    BagWriterTopic about;
    std::uint64_t messages = 0;
  };

  [[nodiscard]] std::string metadataText() const {
    const std::int64_t first = messages_ == 0 ? 0 : first_;
    const std::int64_t duration = messages_ == 0 ? 0 : last_ - first_;
    const std::string times = fmt::format(
        "{{0}}duration:\n{{0}}  nanoseconds: {}\n{{0}}starting_time:\n{{0}}  nanoseconds_since_epoch: {}\n"
        "{{0}}message_count: {}\n",
        duration, first, messages_);
    std::string text =
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n" + indented(times, "  ");
    text += topics_.empty() ? "  topics_with_message_count: []\n" : "  topics_with_message_count:\n";
    for (const Topic& topic : topics_) {
      text += fmt::format(
          "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n"
          "        offered_qos_profiles: \"{}\"\n      message_count: {}\n",
          topic.about.name, ros2Type(topic.about.type), escaped(qosText(topic.about.latched)),
          topic.messages);
    }
    const std::string file = quoted(file_);
    text +=
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " + file + "\n";
    return text + "  files:\n    - path: " + file + "\n" + indented(times, "      ");
  }
  static std::string indented(const std::string& form, const char* blanks) {
    return fmt::format(fmt::runtime(form), blanks);
  }
  /// In single quotes: the user chooses the name, and ` #` or `: ` would end a plain YAML scalar.
  static std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
    return out + "'";
  }
  static std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) out += c == '\n' ? std::string("\\n") : std::string(1, c);
    return out;
  }

  fs::path folder_;
  std::string file_;
  SqliteDatabase database_;
  std::optional<SqliteStatement> insert_;
  std::vector<Topic> topics_;
  std::uint64_t messages_ = 0;
  std::int64_t first_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_ = std::numeric_limits<std::int64_t>::min();
};

}  // namespace

std::unique_ptr<BagWriter> makeRosbag2Writer(const std::string& folder, const std::string& name) {
  return std::make_unique<Rosbag2Writer>(folder, name);
}

}  // namespace swiftlet
