// MCAP files of our own: round trips, unfinished files, and every cut and flip of a small one. Files of other
// writers are read by the test bag_peers.

#include <algorithm>

#include "drivers/bag/unpack.hpp"
#include "tests/drivers/bag/bag_fixture.hpp"

namespace swiftlet {
namespace {

using test::BagFolder;
using test::PlainMessage;
using test::readBack;
using test::refusalOf;
using test::someMessages;

TEST_CASE("an MCAP file gives back what was written, over many chunks", "[mcap]") {
  const BagFolder folder;
  const std::string file = folder.file("a.mcap");
  for (const McapPacking packing : {McapPacking::kNone, McapPacking::kZstd}) {
    const std::vector<PlainMessage> messages = someMessages(300, 20'000);
    test::write(*makeMcapWriter(file, packing), messages);
    const auto bag = openBag(file);
    CHECK(readBack(*bag) == messages);
    CHECK(bag->warnings().empty());
    REQUIRE(bag->topics().size() == 2);
    CHECK(bag->topics()[0].messages + bag->topics()[1].messages == 300);
    CHECK(bag->topics()[0].encoding == BagEncoding::kCdr);
    CHECK(bag->topics()[0].definition == "uint8 x\n");
  }
}

TEST_CASE("messages come by their time, whatever their order in the file", "[mcap]") {
  const BagFolder folder;
  std::vector<PlainMessage> messages = someMessages(400, 10'000);
  std::vector<PlainMessage> mixed = messages;
  std::reverse(mixed.begin(), mixed.end());
  test::write(*makeMcapWriter(folder.file("a.mcap"), McapPacking::kZstd), mixed);
  std::stable_sort(mixed.begin(), mixed.end(),
                   [](const PlainMessage& a, const PlainMessage& b) { return a.time < b.time; });
  CHECK(readBack(folder.file("a.mcap")) == mixed);
}

TEST_CASE("an empty MCAP file has no messages", "[mcap]") {
  const BagFolder folder;
  test::write(*makeMcapWriter(folder.file("a.mcap"), McapPacking::kZstd), {});
  CHECK(readBack(folder.file("a.mcap")).empty());
}

/// Cuts the file ever shorter; the most messages that were read.
std::size_t readCuts(const std::string& file, const std::vector<PlainMessage>& messages, std::size_t step) {
  std::size_t most = 0;
  for (std::size_t size = std::filesystem::file_size(file); size > step;) {
    size -= step;
    std::filesystem::resize_file(file, size);
    if (size < 8) {
      CHECK(refusalOf([&] { (void)openBag(file); }).field == "byte 0");
      continue;
    }
    const auto bag = openBag(file);
    const std::vector<PlainMessage> read = readBack(*bag);
    REQUIRE(read.size() <= messages.size());
    CHECK(std::equal(read.begin(), read.end(), messages.begin()));
    REQUIRE(bag->warnings().size() == 1);
    CHECK(bag->warnings()[0].find("byte ") != std::string::npos);
    most = std::max(most, read.size());
  }
  return most;
}

TEST_CASE("a cut MCAP file gives what is whole and names the byte", "[mcap]") {
  const BagFolder folder;
  const std::string file = folder.file("a.mcap");
  const std::vector<PlainMessage> few = someMessages(10, 20);
  test::write(*makeMcapWriter(file, McapPacking::kNone), few);
  CHECK(readCuts(file, few, 1) == few.size());
  const std::vector<PlainMessage> many = someMessages(40, 100'000);  // four chunks
  test::write(*makeMcapWriter(file, McapPacking::kNone), many);
  constexpr std::size_t kStep = 99'991;
  const std::size_t read = readCuts(file, many, kStep);
  CHECK(read > 30);
  CHECK(read < 40);
}

TEST_CASE("an MCAP file that ends with zeros after a power cut gives the chunks before them", "[mcap]") {
  const BagFolder folder;
  const std::string file = folder.file("a.mcap");
  const std::vector<PlainMessage> messages = someMessages(40, 100'000);  // four chunks
  for (const McapPacking packing : {McapPacking::kNone, McapPacking::kZstd}) {
    test::write(*makeMcapWriter(file, packing), messages);
    const std::vector<std::uint8_t> whole = test::bytesOf(file);
    std::size_t most = 0;
    std::size_t least = messages.size();
    for (std::size_t cut = whole.size() / 3; cut < whole.size(); cut += whole.size() / 97) {
      std::vector<std::uint8_t> bytes = whole;
      std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(cut), bytes.end(), std::uint8_t{0});
      test::writeBytes(file, bytes);
      const auto bag = openBag(file);
      const std::vector<PlainMessage> read = readBack(*bag);
      REQUIRE(read.size() <= messages.size());
      CHECK(std::equal(read.begin(), read.end(), messages.begin()));
      CHECK(bag->warnings().size() == 1);
      most = std::max(most, read.size());
      least = std::min(least, read.size());
    }
    CHECK(least > 5);
    CHECK(most > 25);
  }
}

TEST_CASE("messages that rosbag2 compressed one by one are read from MCAP files", "[mcap]") {
  const BagFolder folder;
  const std::vector<PlainMessage> messages = someMessages(20, 3000);
  std::vector<PlainMessage> packed = messages;
  for (PlainMessage& message : packed) message.body = packZstd(message.body);
  test::write(*makeMcapWriter(folder.file("a.mcap"), McapPacking::kNone), packed);
  CHECK(readBack(folder.file("a.mcap")) == messages);
}

TEST_CASE("every flipped byte of an MCAP file is refused with its place, or changes nothing", "[mcap]") {
  const BagFolder folder;
  const std::string file = folder.file("a.mcap");
  for (const McapPacking packing : {McapPacking::kNone, McapPacking::kZstd}) {
    const std::vector<PlainMessage> messages = someMessages(8, 20);
    test::write(*makeMcapWriter(file, packing), messages);
    const std::vector<std::uint8_t> whole = test::bytesOf(file);
    std::size_t refused = 0;
    std::size_t same = 0;
    for (std::size_t at = 0; at < whole.size(); ++at) {
      const int flip = at % 2 == 0 ? 0xFF : 1 << (at / 2 % 8);
      std::vector<std::uint8_t> bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ flip);
      test::writeBytes(file, bytes);
      try {
        const bool equal = readBack(file) == messages;
        INFO("byte " << at << " with " << flip);
        CHECK(equal);
        ++same;
      } catch (const InputError& error) {
        CHECK(error.field.starts_with("byte "));
        ++refused;
      }
    }
    CHECK(refused > same);
  }
}

}  // namespace
}  // namespace swiftlet
