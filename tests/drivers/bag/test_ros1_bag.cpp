// ROS 1 bags of our own: round trips, unfinished files, and every cut and flip of a small one. Bags of ROS's
// rosbag, and the bytes that it writes, are in tests/drivers/recorded/test_ros_bag.cpp.

#include <algorithm>
#include <cstring>
#include <string_view>

#include "drivers/bag/ros1_records.hpp"
#include "drivers/device/byte_fields.hpp"
#include "tests/drivers/bag/bag_fixture.hpp"

namespace swiftlet {
namespace {

using test::BagFolder;
using test::PlainMessage;
using test::readBack;
using test::refusalOf;
using test::someMessages;

/// Where `text` first is at or behind `from`.
std::size_t placeOf(const std::vector<std::uint8_t>& bytes, std::string_view text, std::size_t from = 0) {
  const auto found =
      std::search(bytes.begin() + static_cast<std::ptrdiff_t>(from), bytes.end(), text.begin(), text.end());
  REQUIRE(found != bytes.end());
  return static_cast<std::size_t>(found - bytes.begin());
}

void putNumber(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t number) {
  LittleFieldWriter(std::span(bytes).subspan(at)).u32(number);
}

std::uint32_t numberAt(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return LittleFieldReader(std::span(bytes).subspan(at)).u32();
}

TEST_CASE("a ROS 1 bag gives back what was written, over many chunks", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(300, 20'000);
  test::write(*makeRos1Writer(file), messages);
  const auto bag = openBag(file);
  CHECK(readBack(*bag) == messages);
  CHECK(bag->warnings().empty());
  REQUIRE(bag->topics().size() == 2);
  CHECK(bag->topics()[0].messages == 100);
  CHECK(bag->topics()[1].messages == 200);
  CHECK(bag->topics()[0].encoding == BagEncoding::kRos1);
  CHECK(bag->topics()[0].definition == "uint8 x\n");
  test::write(*makeRos1Writer(file), {});
  CHECK(readBack(file).empty());
}

TEST_CASE("a cut ROS 1 bag gives what is whole and names the byte", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(40, 100'000);  // six chunks
  test::write(*makeRos1Writer(file), messages);
  const auto whole = static_cast<std::size_t>(std::filesystem::file_size(file));
  std::size_t most = 0;
  for (std::size_t size = whole - 1; size > 8'000; size -= size > whole - 3'000 ? 1 : 99'991) {
    std::filesystem::resize_file(file, size);
    const auto bag = openBag(file);
    const std::vector<PlainMessage> read = readBack(*bag);
    REQUIRE(read.size() <= messages.size());
    CHECK(std::equal(read.begin(), read.end(), messages.begin()));
    // A cut behind the last chunk leaves each message; only the connections are repeated there.
    if (read.size() < messages.size()) REQUIRE(bag->warnings().size() == 1);
    if (!bag->warnings().empty()) CHECK(bag->warnings()[0].find("byte ") != std::string::npos);
    most = std::max(most, read.size());
    if (size < 100'000) CHECK(read.empty());
  }
  CHECK(most == messages.size());
  std::filesystem::resize_file(file, 100);
  CHECK(refusalOf([&] { (void)openBag(file); }).field == "byte 13");
}

TEST_CASE("a ROS 1 bag that its recorder did not close is read to its last message", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(20, 100'000);  // three chunks
  test::write(*makeRos1Writer(file), messages);
  std::vector<std::uint8_t> bytes = test::bytesOf(file);
  std::size_t chunk = 0;  // the size of the last one
  for (int i = 0; i < 3; ++i) chunk = placeOf(bytes, "size=", chunk + 1);
  const std::size_t size_at = chunk + 5;
  const std::size_t end = size_at + 8 + numberAt(bytes, size_at);
  // rosbag puts the length of a chunk into the file when the chunk is complete, and the bag's header at the
  // end.
  putNumber(bytes, size_at, 0);
  putNumber(bytes, size_at + 4, 0);
  std::memset(bytes.data() + placeOf(bytes, "index_pos=") + 10, 0, 8);
  bytes.resize(end);
  test::writeBytes(file, bytes);
  const auto bag = openBag(file);
  CHECK(readBack(*bag) == messages);
  CHECK(bag->warnings().size() == 1);
  const auto first_of = [&](const std::vector<std::uint8_t>& changed, std::ptrdiff_t damaged = 0) {
    test::writeBytes(file, changed);
    const std::vector<PlainMessage> read = readBack(file);
    CHECK(std::equal(read.begin(), read.end() - damaged, messages.begin()));
    return read.size();
  };
  // Killed, after a power cut, and with a compressed chunk: until then it has no length, and then no records.
  CHECK(first_of({bytes.begin(), bytes.end() - 50'000}) == messages.size() - 1);
  std::vector<std::uint8_t> zeros = bytes;
  std::fill(zeros.end() - 150'000, zeros.end(), std::uint8_t{0});
  CHECK(first_of(zeros, 1) == messages.size() - 1);  // a body has no checksum
  std::vector<std::uint8_t> compressed(bytes.begin(), bytes.end() - 50'000);
  const std::size_t packing = placeOf(bytes, "compression=none", chunk - 50);
  putNumber(compressed, packing - 8, numberAt(bytes, packing - 8) - 1);
  putNumber(compressed, packing - 4, numberAt(bytes, packing - 4) - 1);
  std::copy_n("lz4", 3, compressed.begin() + static_cast<std::ptrdiff_t>(packing) + 12);
  compressed.erase(compressed.begin() + static_cast<std::ptrdiff_t>(packing) + 15);
  std::fill(compressed.begin() + static_cast<std::ptrdiff_t>(size_at + 7), compressed.end(),
            std::uint8_t{0xA5});
  CHECK(first_of(compressed) == 16);

  // Damage before the end is no end.
  std::vector<std::uint8_t> damaged = bytes;
  const std::size_t second = placeOf(bytes, "compression=none", placeOf(bytes, "compression=none") + 1);
  damaged[second - 1] = 0xFF;  // of the field's length
  test::writeBytes(file, damaged);
  CHECK(refusalOf([&] { (void)openBag(file); }).field.starts_with("byte "));
}

TEST_CASE("a closed ROS 1 bag needs no indexes of its chunks", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(20, 100'000);  // three chunks
  test::write(*makeRos1Writer(file), messages);
  const std::vector<std::uint8_t> whole = test::bytesOf(file);
  std::vector<std::uint8_t> bytes(whole.begin(), whole.begin() + ros1::kMagic.size());
  for (auto at = bytes.size(); at < whole.size();) {
    const ros1::Head head = ros1::headOf(std::span(whole).subspan(at));
    const std::span record = std::span(whole).subspan(at, head.size + head.length);
    if (head.op != ros1::Op::kIndex) bytes.insert(bytes.end(), record.begin(), record.end());
    at += record.size();
  }
  REQUIRE(bytes.size() < whole.size());
  const std::size_t tail = placeOf(bytes, "index_pos=") + 10;
  const std::uint64_t removed = whole.size() - bytes.size();
  LittleFieldWriter(std::span(bytes).subspan(tail))
      .u64(LittleFieldReader(std::span(bytes).subspan(tail)).u64() - removed);
  test::writeBytes(file, bytes);
  const auto bag = openBag(file);
  CHECK(readBack(*bag) == messages);
  CHECK(bag->warnings().empty());
}

TEST_CASE("an index that points to the connection before its message is followed", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(6, 20);
  test::write(*makeRos1Writer(file), messages);
  std::vector<std::uint8_t> bytes = test::bytesOf(file);
  const std::size_t index =
      placeOf(bytes, "ver=") + 4;  // of the first connection; its version and length, then entries
  const std::size_t offset = index + 4 + 4 + 8;
  REQUIRE(numberAt(bytes, offset) > 0);
  putNumber(bytes, offset, 0);
  test::writeBytes(file, bytes);
  CHECK(readBack(file) == messages);
}

TEST_CASE("ROS 1 bags that cannot be read are refused with the reason", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  test::write(*makeRos1Writer(file), someMessages(6, 20));
  const std::vector<std::uint8_t> whole = test::bytesOf(file);
  const auto refusal_with = [&](std::string_view text, std::string_view other) {
    std::vector<std::uint8_t> bytes = whole;
    std::copy(other.begin(), other.end(), bytes.begin() + static_cast<std::ptrdiff_t>(placeOf(bytes, text)));
    test::writeBytes(file, bytes);
    return refusalOf([&] { (void)openBag(file); });
  };
  CHECK(refusal_with("compression=none", "compression=zstd").message.find("`zstd`") != std::string::npos);
  CHECK(refusal_with("conn_count=", "encryptor=x").message.find("encrypted with x") != std::string::npos);
  CHECK(refusal_with("ver=\x01", "ver=\x02").message == "a chunk's index is damaged");
  std::vector<std::uint8_t> bytes = whole;
  putNumber(bytes, bytes.size() - 4, 5);  // the tail's last count
  test::writeBytes(file, bytes);
  CHECK(refusalOf([&] { (void)openBag(file); }).message == "it counts 7 messages, but holds 6");
}

TEST_CASE("a full disk is said by the writers of ROS 1 bags and of MCAP files", "[ros1_bag][mcap]") {
  const std::vector<PlainMessage> messages = someMessages(6, 20);
  for (const bool ros1 : {true, false}) {
    const InputError error = refusalOf([&] {
      test::write(ros1 ? *makeRos1Writer("/dev/full") : *makeMcapWriter("/dev/full", McapPacking::kNone),
                  messages);
    });
    CHECK(error.file == "/dev/full");
    CHECK(error.message.find("No space left") != std::string::npos);
  }
}

TEST_CASE("every flipped byte of a ROS 1 bag is refused, or loses no message", "[ros1_bag]") {
  const BagFolder folder;
  const std::string file = folder.file("a.bag");
  const std::vector<PlainMessage> messages = someMessages(8, 20);
  test::write(*makeRos1Writer(file), messages);
  const std::vector<std::uint8_t> whole = test::bytesOf(file);
  std::size_t refused = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    const bool padding = at > 200 && at < 4'000;
    if (padding) continue;
    for (const int flip : {0xFF, 1 << (at % 8)}) {
      std::vector<std::uint8_t> bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ flip);
      test::writeBytes(file, bytes);
      INFO("byte " << at << " with " << flip);
      try {
        // The format has no checksums: names and bodies may differ.
        const std::size_t read = readBack(file).size();
        CHECK(read == messages.size());
      } catch (const InputError& error) {
        const bool named = error.field.starts_with("byte ") || error.field == "timestamp";
        CHECK(named);
        ++refused;
      }
    }
  }
  CHECK(refused > whole.size() / 10);
}

}  // namespace
}  // namespace swiftlet
