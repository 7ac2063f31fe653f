// What is demanded of every decoder, whatever comes in:
// - readings, edges, counters and arrivals do not depend on how the bytes were cut into reads;
// - readings are finite, in order of arrival, and every byte and frame is counted once;
// - after the worst garbage, good frames are found again within the longest frame's length.
// Each input is read as it is, and with all checksums made right, so that wrong contents get past them.

#include "tests/fuzz/fuzz_decoders.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "drivers/device/byte_fields.hpp"
#include "drivers/device/crc16.hpp"
#include "drivers/serial/imu_decoder.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr Stamp kStart{1'000'000'000'000};
constexpr Duration kByteTime{10'851};  // 921600 baud, to the nanosecond

struct Result {
  std::vector<ImuReading> readings;
  std::vector<TriggerEdge> edges;
  std::vector<std::int64_t> timesync;
  StreamCounters counters;
  std::size_t waiting = 0;
};

bool same(const ImuReading& a, const ImuReading& b) {
  return a.arrival == b.arrival && a.device == b.device && a.counter == b.counter && a.gyro == b.gyro &&
         a.accel == b.accel;
}

/// `piece(at)`: how many bytes the read at place `at` gives.
template <typename Piece>
Result decode(ImuDecoder& decoder, const Bytes& bytes, Piece&& piece) {
  Result result;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t size = std::min({piece(at), bytes.size() - at, ImuDecoder::kMostFed});
    const auto last = static_cast<std::int64_t>(at + size - 1);
    const Stamp read_at = kStart + Duration{last * kByteTime.ns};
    demand(decoder.feed(std::span(bytes).subspan(at, size), read_at, kByteTime) == size);
    at += size;
    ImuReading reading;
    while (decoder.next(reading)) result.readings.push_back(reading);
    TriggerEdge edge;
    while (decoder.nextEdge(edge)) result.edges.push_back(edge);
    ReceivedMavlink heard;
    while (decoder.nextMavlink(heard)) {
      if (const auto* timesync = std::get_if<mavlink::Timesync>(&heard.message)) {
        result.timesync.push_back(timesync->tc1);
        result.timesync.push_back(timesync->ts1);
      }
      result.timesync.push_back(heard.arrival.ns);
    }
  }
  result.counters = decoder.counters();
  result.waiting = decoder.waiting();
  return result;
}

void demandSound(const Result& result, std::size_t size) {
  const StreamCounters& c = result.counters;
  demand(c.bytes == size && c.bytes == c.framed_bytes + c.skipped_bytes + result.waiting);
  demand(c.frames == c.samples + c.unknown_kinds + c.without_sample + c.not_finite);
  demand(c.samples == result.readings.size() && c.edges == result.edges.size() && c.events_refused == 0);
  demand(c.checksum_failures <= c.skipped_bytes);
  Stamp last = kStart;
  for (const ImuReading& reading : result.readings) {
    demand(reading.gyro.allFinite() && reading.accel.allFinite());
    demand(reading.arrival >= last);
    last = reading.arrival + kByteTime;
  }
}

void demandSame(const Result& a, const Result& b) {
  demand(a.counters == b.counters && a.waiting == b.waiting);
  demand(std::equal(a.readings.begin(), a.readings.end(), b.readings.begin(), b.readings.end(), &same));
  demand(a.edges == b.edges && a.timesync == b.timesync);
}

/// More good frames than the longest frame that garbage can announce: the last of them must come out.
void demandRecovery(ImuDecoder& decoder, ImuProtocol protocol) {
  ImuEncoder encoder(protocol);
  ImuReading sent;
  sent.gyro = {0.125, -0.25, 0.5};
  sent.accel = {1, 2, -9.5};
  Bytes good;
  for (std::int64_t i = 1; good.size() < Xsens::kLongestFrame + 2 * ImuEncoder::kLongestFrame; ++i) {
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame = {};
    sent.device = Stamp{i * 2'500'000};
    sent.counter = static_cast<std::uint64_t>(i);
    const std::size_t length = encoder.encode(sent, frame);
    good.insert(good.end(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(length));
  }
  const Result result = decode(decoder, good, [](std::size_t) { return ImuDecoder::kMostFed; });
  demand(!result.readings.empty());
  // MIP sends g: the last bit of a product.
  demand((result.readings.back().accel - sent.accel).norm() < 1e-5 && result.waiting == 0);
}

void demandAll(ImuProtocol protocol, Bytes bytes) {
  if (protocol == ImuProtocol::kMavlink) {
    // The decoder keeps to the first sender: let it be the one that is to be heard again.
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame = {};
    ImuReading first;
    first.device = Stamp{1'000'000};
    const std::size_t length = ImuEncoder(protocol).encode(first, frame);
    bytes.insert(bytes.begin(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(length));
  }
  ImuDecoder whole(protocol), single(protocol), pieces(protocol);
  const Result result = decode(whole, bytes, [](std::size_t) { return ImuDecoder::kMostFed; });
  demandSound(result, bytes.size());
  demandSame(result, decode(single, bytes, [](std::size_t) { return std::size_t{1}; }));
  demandSame(result, decode(pieces, bytes, [&](std::size_t at) { return std::size_t{1} + bytes[at] % 61U; }));
  demandRecovery(whole, protocol);
}

using Spoiled = FrameCheck (*)(std::span<const std::uint8_t>);
using Repair = void (*)(std::span<std::uint8_t>);

Bytes withChecksums(Bytes bytes, Spoiled check, Repair repair) {
  for (std::size_t at = 0; at < bytes.size();) {
    const FrameCheck found = check(std::span<const std::uint8_t>(bytes).subspan(at));
    const bool spoiled = found.verdict == FrameVerdict::kBadChecksum;
    if (spoiled) repair(std::span(bytes).subspan(at, found.length));
    at += spoiled || found.verdict == FrameVerdict::kWhole ? found.length : 1;
  }
  return bytes;
}

void run(ImuProtocol protocol, std::string_view text, Spoiled check, Repair repair) {
  // Longer inputs say nothing new and take time.
  constexpr std::size_t kLongest = 8192;
  const Bytes bytes(text.begin(),
                    text.begin() + static_cast<std::ptrdiff_t>(std::min(text.size(), kLongest)));
  demandAll(protocol, bytes);
  demandAll(protocol, withChecksums(bytes, check, repair));
}

FrameCheck checkMavlink(std::span<const std::uint8_t> bytes) {
  const MavlinkHeader header = readMavlinkHeader(bytes);
  if (header.verdict != MavlinkHeader::Verdict::kRead || bytes.size() < header.frame_length) return {};
  return {FrameVerdict::kBadChecksum, header.frame_length};
}

void repairMavlink(std::span<std::uint8_t> frame) {
  const MavlinkHeader header = readMavlinkHeader(frame);
  const std::uint8_t crc_extra = knownCrcExtra(header.message).value_or(7);
  const std::size_t end = header.payload_begin + header.payload_length;
  LittleFieldWriter(frame.subspan(end, 2)).u16(mavlinkChecksum(frame, header, crc_extra));
}

void repairXsens(std::span<std::uint8_t> frame) {
  unsigned sum = 0;
  for (std::size_t i = 1; i + 1 < frame.size(); ++i) sum += frame[i];
  frame.back() = static_cast<std::uint8_t>(-sum & 0xFFU);
}

void repairMip(std::span<std::uint8_t> frame) {
  unsigned a = 0, b = 0;
  for (std::size_t i = 0; i + 2 < frame.size(); ++i) {
    a += frame[i];
    b += a;
  }
  frame[frame.size() - 2] = static_cast<std::uint8_t>(a & 0xFFU);
  frame.back() = static_cast<std::uint8_t>(b & 0xFFU);
}

void repairVectorNav(std::span<std::uint8_t> frame) {
  const std::uint16_t crc = crc16Ccitt(0, frame.subspan(1, frame.size() - 3));
  BigFieldWriter(frame.last(2)).u16(crc);
}

void repairBridge(std::span<std::uint8_t> frame) {
  const std::uint16_t crc = crc16Ccitt(0xFFFF, frame.subspan(2, frame.size() - 4));
  LittleFieldWriter(frame.last(2)).u16(crc);
}

}  // namespace

void vectornavStream(std::string_view text) {
  run(ImuProtocol::kVectorNav, text, &VectorNav::check, &repairVectorNav);
}
void xsensStream(std::string_view text) { run(ImuProtocol::kXsens, text, &Xsens::check, &repairXsens); }
void mipStream(std::string_view text) { run(ImuProtocol::kMip, text, &Mip::check, &repairMip); }
void mavlinkStream(std::string_view text) { run(ImuProtocol::kMavlink, text, &checkMavlink, &repairMavlink); }
void bridgeStream(std::string_view text) { run(ImuProtocol::kBridge, text, &Bridge::check, &repairBridge); }

}  // namespace swiftlet::fuzz
