#include "tests/fuzz/fuzz_bag.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "drivers/bag/mcap_file.hpp"
#include "drivers/bag/message_coder.hpp"
#include "drivers/bag/ros1_file.hpp"
#include "drivers/bag/rosbag2_folder.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/grey_copier.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

/// What was read is written to the same message again.
template <rosmsg::Message T>
void readMessage(std::span<const std::uint8_t> body, BagEncoding encoding) {
  T message;
  if (!decode(body, encoding, message)) return;
  std::vector<std::uint8_t> first;
  encode(message, encoding, first);
  T again;
  demand(decode(first, encoding, again));
  std::vector<std::uint8_t> second;
  encode(again, encoding, second);
  demand(first == second);
}

void readImage(std::span<const std::uint8_t> body, BagEncoding encoding) {
  rosmsg::Image image;
  constexpr std::uint32_t kMaxPixels = 1 << 16;
  if (!decode(body, encoding, image) || image.width == 0 || image.height == 0) return;
  if (image.width > kMaxPixels / image.height) return;
  std::vector<std::uint8_t> out(std::size_t{image.width} * image.height);
  const ImageSize size{static_cast<int>(image.width), static_cast<int>(image.height)};
  ImageSize found;
  GreyCopier copier;
  const DecodeResult result = copier.copy(image, size, out.data(), found);
  demand(result == DecodeResult::kDamaged || found == size);
}

/// Entries are in order and each message can be read, or the error names the file.
template <typename Open>
void readBagFile(std::string_view text, Open&& open, bool names_byte) {
  const int file = ::memfd_create("bag", MFD_CLOEXEC);
  demand(file >= 0 && ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  try {
    const auto bag = open("/proc/self/fd/" + std::to_string(file), "bag");
    Stamp newest{};
    std::size_t counted = 0;
    for (const BagTopic& topic : bag->topics()) counted += topic.messages;
    demand(counted == bag->entries().size());
    for (const BagEntry& entry : bag->entries()) {
      demand(entry.topic < bag->topics().size() && newest <= entry.log_time);
      newest = entry.log_time;
      std::uint8_t sum = 0;  // each byte is looked at
      for (const std::uint8_t byte : bag->read(entry)) sum = static_cast<std::uint8_t>(sum + byte);
      (void)sum;
    }
  } catch (const InputError& error) {
    demand(error.file.starts_with("bag") && !error.remedy.empty());
    demand(!names_byte || error.field.starts_with("byte "));
  }
  ::close(file);
}

}  // namespace

void rosMessage(std::string_view text) {
  const std::span<const std::uint8_t> body(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  for (const BagEncoding encoding : {BagEncoding::kRos1, BagEncoding::kCdr}) {
    readMessage<rosmsg::Imu>(body, encoding);
    readMessage<rosmsg::CompressedImage>(body, encoding);
    readMessage<rosmsg::CameraInfo>(body, encoding);
    readMessage<rosmsg::Marker>(body, encoding);
    readMessage<rosmsg::DiagnosticArray>(body, encoding);
    readMessage<rosmsg::TFMessage>(body, encoding);
    readMessage<rosmsg::Odometry>(body, encoding);
    readImage(body, encoding);
  }
}

void mcap(std::string_view text) { readBagFile(text, openMcapFile, true); }

void ros1Bag(std::string_view text) { readBagFile(text, openRos1File, false); }

void rosbag2Metadata(std::string_view text) {
  try {
    const Rosbag2Metadata metadata = parseRosbag2Metadata("metadata.yaml", text);
    demand(!metadata.files.empty());
  } catch (const InputError&) {
  }
}

}  // namespace swiftlet::fuzz
