// rosbag2's folders and SQLite files in all that its releases write; the tables are made here with SQL.

#include <sqlite3.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>

#include "drivers/bag/rosbag2_folder.hpp"
#include "drivers/bag/unpack.hpp"
#include "tests/drivers/bag/bag_fixture.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using test::BagFolder;
using test::PlainMessage;
using test::readBack;
using test::refusalOf;
using test::someMessages;

/// A database with a connection of its own that may stay open.
class Tables {
 public:
  explicit Tables(const std::string& path) { REQUIRE(sqlite3_open(path.c_str(), &database_) == SQLITE_OK); }
  ~Tables() { sqlite3_close(database_); }
  Tables(const Tables&) = delete;
  Tables& operator=(const Tables&) = delete;

  void run(const std::string& text) {
    char* error = nullptr;
    const int result = sqlite3_exec(database_, text.c_str(), nullptr, nullptr, &error);
    INFO(text << ": " << (error == nullptr ? "" : error));
    REQUIRE(result == SQLITE_OK);
  }
  void schema(int version) {
    const std::string qos = version >= 2 ? ", offered_qos_profiles TEXT NOT NULL" : "";
    const std::string hash = version >= 4 ? ", type_description_hash TEXT NOT NULL" : "";
    run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL" +
        qos + hash +
        ");"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT "
        "NULL, "
        "data BLOB NOT NULL); CREATE INDEX timestamp_idx ON messages (timestamp ASC);");
    if (version >= 3) {
      run("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
          "INSERT INTO schema VALUES (" +
          std::to_string(version) + ", 'x');");
    }
    if (version >= 4) {
      run("CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT "
          "NOT "
          "NULL, encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);"
          "INSERT INTO message_definitions VALUES (1, 'sensor_msgs/msg/Imu', 'ros2msg', 'float64 x', '');");
    }
    const std::string more = (version >= 2 ? std::string(", ''") : "") + (version >= 4 ? ", ''" : "");
    run("INSERT INTO topics VALUES (11, '/camera/info', 'sensor_msgs/msg/CameraInfo', 'cdr'" + more +
        ");"
        "INSERT INTO topics VALUES (5, '/imu', 'sensor_msgs/msg/Imu', 'cdr'" +
        more + ");");
  }
  void fill(const std::vector<PlainMessage>& messages, bool packed = false) {
    run("BEGIN");
    for (const PlainMessage& message : messages) {
      const std::vector<std::uint8_t> body = packed ? packZstd(message.body) : message.body;
      std::string hex;
      for (const std::uint8_t byte : body) {
        hex += "0123456789ABCDEF"[byte >> 4];
        hex += "0123456789ABCDEF"[byte & 15];
      }
      run("INSERT INTO messages(topic_id, timestamp, data) VALUES (" +
          std::string(message.topic == "/imu" ? "5" : "11") + ", " + std::to_string(message.time) + ", X'" +
          hex + "')");
    }
    run("COMMIT");
  }

 private:
  sqlite3* database_ = nullptr;
};

std::string metadata(int version, const std::vector<std::string>& files, std::size_t messages) {
  std::string text = "rosbag2_bagfile_information:\n  version: " + std::to_string(version) +
                     "\n  storage_identifier: sqlite3\n  relative_file_paths:\n";
  for (const std::string& file : files) text += "    - " + file + "\n";
  return text +
         "  duration:\n    nanoseconds: 1\n  starting_time:\n    nanoseconds_since_epoch: 1\n  "
         "message_count: " +
         std::to_string(messages) + "\n  topics_with_message_count: []\n";
}

void writeText(const std::string& path, const std::string& text) {
  test::writeBytes(path, {text.begin(), text.end()});
}

TEST_CASE("SQLite files of every schema are read, alone and in their folders", "[rosbag2]") {
  const std::vector<PlainMessage> messages = someMessages(60, 5000);
  for (int schema = 1; schema <= 4; ++schema) {
    const BagFolder folder;
    {
      Tables tables(folder.file("bag_0.db3"));
      tables.schema(schema);
      tables.fill(messages);
    }
    const auto bag = openBag(folder.file("bag_0.db3"));
    CHECK(readBack(*bag) == messages);
    for (const BagTopic& topic : bag->topics()) {
      CHECK(topic.definition == (schema >= 4 && topic.name == "/imu" ? "float64 x" : ""));
    }
    for (int version = 4; version <= 9; ++version) {
      writeText(folder.file("metadata.yaml"), metadata(version, {"bag_0.db3"}, messages.size()));
      const auto whole = openBag(folder.file("."));
      CHECK(readBack(*whole) == messages);
      CHECK(whole->warnings().empty());
    }
  }
}

TEST_CASE("what our writer writes is read back", "[rosbag2]") {
  const BagFolder folder;
  const std::vector<PlainMessage> messages = someMessages(100, 300);
  test::write(*makeRosbag2Writer(folder.file("flight"), "flight"), messages);
  REQUIRE(isBag(folder.file("flight")));
  const auto bag = openBag(folder.file("flight"));
  CHECK(readBack(*bag) == messages);
  CHECK(bag->warnings().empty());
}

TEST_CASE("a bag is found in its folder whatever the folder's name", "[rosbag2]") {
  const BagFolder folder;
  const auto messages = someMessages(3, 10);
  for (const char* name : {"run #2", "room: second try", "it's", "{a}", "- b"}) {
    INFO(name);
    test::write(*makeRosbag2Writer(folder.file(name), name), messages);
    CHECK(readBack(folder.file(name)) == messages);
  }
}

TEST_CASE("a bag of several files is one, packed and of other storage too", "[rosbag2]") {
  const BagFolder folder;
  const std::vector<PlainMessage> messages = someMessages(90, 2000);
  const auto part = [&](int i) {
    return std::vector<PlainMessage>(messages.begin() + 30 * i, messages.begin() + 30 * i + 30);
  };
  {
    Tables tables(folder.file("bag_0.db3"));
    tables.schema(3);
    tables.fill(part(0));
  }
  {
    Tables tables(folder.file("bag_9.db3"));
    tables.schema(3);
    tables.fill(part(1), true);
  }
  test::write(*makeMcapWriter(folder.file("plain.mcap"), McapPacking::kNone), part(2));
  test::writeBytes(folder.file("bag_10.mcap.zstd"), packZstd(test::bytesOf(folder.file("plain.mcap"))));
  fs::remove(folder.file("plain.mcap"));
  // Without metadata.yaml 9 comes before 10.
  const auto unlisted = openBag(folder.file("."));
  CHECK(readBack(*unlisted) == messages);
  REQUIRE(unlisted->warnings().size() == 1);
  CHECK(unlisted->warnings()[0].find("no metadata.yaml") != std::string::npos);
  // As older recorders list them: with the folder's name before.
  writeText(folder.file("metadata.yaml"),
            metadata(4, {"x/bag_0.db3", "x/bag_9.db3", "x/bag_10.mcap.zstd"}, 91));
  const auto bag = openBag(folder.file("."));
  CHECK(readBack(*bag) == messages);
  REQUIRE(bag->warnings().size() == 1);
  CHECK(bag->warnings()[0].find("91") != std::string::npos);
  // Nothing of what was unpacked is left.
  for (const auto& entry : fs::directory_iterator(fs::temp_directory_path())) {
    CHECK(entry.path().filename().string().find("swiftlet_bag_") == std::string::npos);
  }
}

TEST_CASE("a compressed file is whole, however many bytes it unpacks to", "[rosbag2]") {
  const BagFolder folder;
  for (const std::size_t size : {131071, 131072, 131073, 262144}) {  // zstd gives at most 131072 at once
    const std::vector<std::uint8_t> bytes(size, 7);
    test::writeBytes(folder.file("a.mcap.zstd"), packZstd(bytes));
    CHECK(test::bytesOf(UnpackedFile(folder.file("a.mcap.zstd")).path()) == bytes);
  }
}

TEST_CASE("changes that a killed recorder left beside the file belong to it", "[rosbag2]") {
  const BagFolder folder;
  const std::vector<PlainMessage> messages = someMessages(20, 100);
  Tables recorder(folder.file("live.db3"));
  recorder.run("PRAGMA journal_mode = WAL");
  recorder.schema(3);
  recorder.fill(messages);
  // As a kill leaves them: while the recorder has them open.
  fs::copy(folder.file("live.db3"), folder.file("bag.db3"));
  fs::copy(folder.file("live.db3-wal"), folder.file("bag.db3-wal"));
  REQUIRE(fs::file_size(folder.file("bag.db3-wal")) > 1000);
  CHECK(readBack(folder.file("bag.db3")) == messages);
}

TEST_CASE("rosbag2 bags that are damaged or not whole are refused with the place", "[rosbag2]") {
  const BagFolder folder;
  const std::string file = folder.file("bag.db3");
  const std::vector<PlainMessage> messages = someMessages(60, 3000);
  {
    Tables tables(file);
    tables.schema(3);
    tables.fill(messages);
    tables.run("UPDATE messages SET topic_id = 99 WHERE id = 7");
  }
  CHECK(refusalOf([&] { (void)openBag(file); }).field == "messages, row 7");
  {
    Tables tables(file);
    tables.run(
        "UPDATE messages SET topic_id = 5 WHERE id = 7; UPDATE messages SET data = 'text' WHERE id = 8");
  }
  CHECK(refusalOf([&] { (void)readBack(file); }).field == "messages, row 8");
  {
    Tables tables(file);
    tables.run("UPDATE messages SET data = X'28B52FFD00112233' WHERE id = 8");
  }
  CHECK(refusalOf([&] { (void)readBack(file); }).message.find("zstd") != std::string::npos);
  {
    Tables tables(file);
    tables.run("DROP TABLE messages");
  }
  CHECK(refusalOf([&] { (void)openBag(file); }).field == "table messages");
  writeText(folder.file("metadata.yaml"), metadata(5, {"gone.db3"}, 1));
  CHECK(refusalOf([&] { (void)openBag(folder.file(".")); }).message.find("does not exist") !=
        std::string::npos);
  const auto refusedText = [](const std::string& text) {
    return refusalOf([&] { (void)parseRosbag2Metadata("metadata.yaml", text); });
  };
  CHECK(refusedText("a: [1\n").line == 2);
  CHECK(refusedText("x: 1\n").field == "rosbag2_bagfile_information");
  CHECK(refusedText(metadata(10, {"a.db3"}, 1)).field == "version");
  CHECK(refusedText(metadata(5, {"../a.db3"}, 1)).field == "relative_file_paths");
  CHECK(refusedText(metadata(5, {}, 1)).field == "relative_file_paths");
}

TEST_CASE("a cut SQLite file is refused with the row, or the same is read", "[rosbag2]") {
  const BagFolder folder;
  const std::string file = folder.file("bag.db3");
  const std::vector<PlainMessage> messages = someMessages(30, 3000);
  {
    Tables tables(file);
    tables.schema(3);
    tables.fill(messages);
  }
  const std::vector<std::uint8_t> whole = test::bytesOf(file);
  const std::string cut = folder.file("cut.db3");
  for (std::size_t size = 0; size < whole.size(); size += size + 9000 < whole.size() ? 1021 : 97) {
    test::writeBytes(cut, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
    try {
      const bool equal = readBack(cut) == messages;
      INFO("cut to " << size);
      CHECK(equal);
    } catch (const InputError& error) {
      CHECK(error.file == cut);
    }
  }
  // A database has no checksums: what flips inside a message is read as it is. All else is refused or
  // harmless.
  std::size_t refused = 0;
  for (std::size_t at = 0; at < whole.size(); at += 409) {
    std::vector<std::uint8_t> bytes = whole;
    bytes[at] ^= 0x41;
    test::writeBytes(cut, bytes);
    try {
      (void)readBack(cut);
    } catch (const InputError& error) {
      CHECK(error.file == cut);
      ++refused;
    }
  }
  CHECK(refused > 0);
}

}  // namespace
}  // namespace swiftlet
