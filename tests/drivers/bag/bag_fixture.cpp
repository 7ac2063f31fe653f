#include "tests/drivers/bag/bag_fixture.hpp"

#include <unistd.h>

#include <fstream>
#include <map>

namespace swiftlet::test {

BagFolder::BagFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "swiftlet_test_bag_XXXXXX").string();
  REQUIRE(::mkdtemp(name.data()) != nullptr);
  path_ = name;
}

BagFolder::~BagFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<PlainMessage> someMessages(int count, std::size_t bytes) {
  std::vector<PlainMessage> messages;
  for (int i = 0; i < count; ++i) {
    const bool imu = i % 3 != 0;
    PlainMessage message{imu ? "/imu" : "/camera/info",
                         imu ? "sensor_msgs/Imu" : "sensor_msgs/CameraInfo",
                         1'700'000'000'000'000'000 + i / 2 * 5'000'000,
                         {0, 1, 0, 0}};
    for (std::size_t k = 0; k < bytes; ++k)
      message.body.push_back(static_cast<std::uint8_t>(7 * i + static_cast<int>(k)));
    messages.push_back(message);
  }
  return messages;
}

void write(BagWriter& writer, const std::vector<PlainMessage>& messages) {
  std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> topics;  // number, messages
  for (const PlainMessage& message : messages) {
    if (!topics.contains(message.topic)) {
      topics[message.topic] = {writer.addTopic({message.topic, message.type, "uint8 x\n", "", false}), 0};
    }
    auto& [number, sequence] = topics[message.topic];
    writer.write(number, Stamp{message.time}, sequence++, message.body);
  }
  writer.finish();
}

std::vector<PlainMessage> readBack(BagFile& bag) {
  std::vector<PlainMessage> messages;
  for (const BagEntry& entry : bag.entries()) {
    const BagTopic& topic = bag.topics()[entry.topic];
    const std::span<const std::uint8_t> body = bag.read(entry);
    messages.push_back({topic.name, topic.type, entry.log_time.ns, {body.begin(), body.end()}});
  }
  return messages;
}

std::vector<PlainMessage> readBack(const std::string& path) {
  const auto bag = openBag(path);
  return readBack(*bag);
}

void writeBytes(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  REQUIRE(file.good());
}

}  // namespace swiftlet::test
