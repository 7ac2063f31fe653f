#include "firmware_host/lab/import/gpmf.hpp"

#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <string>
#include <string_view>

namespace swiftlet {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kHead = 8;
constexpr double kMostSamples = 1e15;  // a double counts them one by one
constexpr int kDeepest = 8;            // nested entries; files have three levels

std::uint64_t bigEndian(Bytes bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = (value << 8U) | byte;
  return value;
}

struct Entry {
  std::string_view key;
  char type = 0;  ///< 0: contains entries
  std::size_t size = 0;
  std::size_t count = 0;
  Bytes data;
};

/// Removes the first entry from `rest` and returns it.
std::optional<Entry> takeEntry(Bytes& rest) {
  if (rest.size() < kHead) return std::nullopt;
  Entry entry;
  entry.key = {reinterpret_cast<const char*>(rest.data()), 4};
  entry.type = static_cast<char>(rest[4]);
  entry.size = rest[5];
  entry.count = bigEndian(rest.subspan(6, 2));
  const std::size_t bytes = entry.size * entry.count;
  const std::size_t padded = (bytes + 3) / 4 * 4;
  rest = rest.subspan(kHead);
  if (rest.size() < padded) return std::nullopt;
  entry.data = rest.first(bytes);
  rest = rest.subspan(padded);
  return entry;
}

std::size_t bytesOf(char type) {
  switch (type) {
    case 'b':
    case 'B':
      return 1;
    case 's':
    case 'S':
      return 2;
    case 'l':
    case 'L':
    case 'f':
      return 4;
    case 'd':
    case 'j':
    case 'J':
      return 8;
    default:
      return 0;
  }
}

double numberOf(char type, Bytes bytes) {
  const std::uint64_t raw = bigEndian(bytes);
  switch (type) {
    case 'b':
      return static_cast<std::int8_t>(raw);
    case 's':
      return static_cast<std::int16_t>(raw);
    case 'l':
      return static_cast<std::int32_t>(raw);
    case 'j':
      return static_cast<double>(static_cast<std::int64_t>(raw));
    case 'f':
      return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
    case 'd':
      return std::bit_cast<double>(raw);
    default:
      return static_cast<double>(raw);
  }
}

/// The numbers of an entry; empty if it has none.
std::vector<double> numbersOf(const Entry& entry) {
  std::vector<double> numbers;
  const std::size_t each = bytesOf(entry.type);
  if (each == 0 || entry.data.size() % each != 0) return numbers;
  for (std::size_t i = 0; i < entry.data.size(); i += each) {
    numbers.push_back(numberOf(entry.type, entry.data.subspan(i, each)));
  }
  return numbers;
}

/// Properties of the values that follow in a stream.
struct Stream {
  std::array<double, 3> scale = {1, 1, 1};
  std::string orientation;
  std::optional<std::uint64_t> total;
};

/// Matrix whose row for an axis selects the channel with that letter.
std::optional<Eigen::Matrix3d> axesOf(const std::string& orientation) {
  if (orientation.size() < 3) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (int channel = 0; channel < 3; ++channel) {
    const char letter = orientation[static_cast<std::size_t>(channel)];
    const int axis = std::tolower(static_cast<unsigned char>(letter)) - 'x';
    if (axis < 0 || axis > 2) return std::nullopt;
    axes(axis, channel) = letter < 'a' ? 1 : -1;
  }
  // Each axis must occur once.
  if (std::abs(axes.determinant()) < 0.5) return std::nullopt;
  return axes;
}

bool takeValues(const Entry& entry, const Stream& stream, GpmfChannel& channel) {
  const std::vector<double> numbers = numbersOf(entry);
  const std::optional<Eigen::Matrix3d> axes = axesOf(stream.orientation);
  if (!axes || entry.size != 3 * bytesOf(entry.type) || numbers.size() != 3 * entry.count) return false;
  channel.counted = stream.total.has_value() && *stream.total >= entry.count;
  if (channel.counted) channel.before = *stream.total - entry.count;
  for (std::size_t i = 0; i < numbers.size(); i += 3) {
    const Eigen::Vector3d value(numbers[i] / stream.scale[0], numbers[i + 1] / stream.scale[1],
                                numbers[i + 2] / stream.scale[2]);
    if (!value.allFinite()) return false;
    channel.values.push_back(*axes * value);
  }
  return true;
}

bool setScale(const Entry& entry, Stream& stream) {
  const std::vector<double> scale = numbersOf(entry);
  if (scale.empty()) return false;
  for (std::size_t i = 0; i < 3; ++i) {
    stream.scale[i] = scale[scale.size() >= 3 ? i : 0];
    if (stream.scale[i] == 0) return false;
  }
  return true;
}

bool read(Bytes bytes, int depth, GpmfPayload& payload) {
  Stream stream;
  while (bytes.size() >= kHead) {
    const std::optional<Entry> entry = takeEntry(bytes);
    if (!entry) return false;
    bool good = true;
    if (entry->type == 0) {
      good = depth < kDeepest && read(entry->data, depth + 1, payload);
    } else if (entry->key == "SCAL") {
      // For other sensors the entry may have any content.
      if (!setScale(*entry, stream)) stream.scale = {1, 1, 1};
    } else if (entry->key == "ORIN") {
      stream.orientation.assign(reinterpret_cast<const char*>(entry->data.data()), entry->data.size());
    } else if (entry->key == "TSMP") {
      const std::vector<double> total = numbersOf(*entry);
      if (!total.empty() && total[0] >= 0 && total[0] < kMostSamples)
        stream.total = static_cast<std::uint64_t>(total[0]);
    } else if (entry->key == "ACCL") {
      good = takeValues(*entry, stream, payload.accel);
    } else if (entry->key == "GYRO") {
      good = takeValues(*entry, stream, payload.gyro);
    }
    if (!good) return false;
  }
  return bytes.empty();
}

}  // namespace

std::optional<GpmfPayload> readGpmf(std::span<const std::uint8_t> bytes) {
  GpmfPayload payload;
  if (!read(bytes, 0, payload)) return std::nullopt;
  return payload;
}

}  // namespace swiftlet
