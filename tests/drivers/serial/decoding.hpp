#pragma once
// Bytes through a decoder in pieces, with the clock of a wire.

#include <vector>

#include "drivers/serial/imu_decoder.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "tests/drivers/protocol_vectors.hpp"

namespace swiftlet::test {

constexpr Stamp kFirstByte{5'000'000'000};
constexpr Duration kByteTime{10'000};
constexpr ImuProtocol kProtocols[] = {ImuProtocol::kVectorNav, ImuProtocol::kXsens, ImuProtocol::kMip,
                                      ImuProtocol::kMavlink, ImuProtocol::kBridge};

struct Decoded {
  std::vector<ImuReading> readings;
  std::vector<TriggerEdge> edges;
  std::vector<ReceivedMavlink> heard;
};

/// Byte k of the stream arrives at kFirstByte + k byte times, whatever the pieces (0: whole).
inline Decoded decode(ImuDecoder& decoder, const Bytes& bytes, std::size_t piece = 0) {
  Decoded out;
  if (piece == 0) piece = ImuDecoder::kMostFed;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    const std::size_t size = std::min(piece, bytes.size() - at);
    const Stamp read_at = kFirstByte + Duration{static_cast<std::int64_t>(at + size - 1) * kByteTime.ns};
    REQUIRE(decoder.feed(std::span(bytes).subspan(at, size), read_at, kByteTime) == size);
    ImuReading reading;
    while (decoder.next(reading)) out.readings.push_back(reading);
    TriggerEdge edge;
    while (decoder.nextEdge(edge)) out.edges.push_back(edge);
    ReceivedMavlink heard;
    while (decoder.nextMavlink(heard)) out.heard.push_back(heard);
  }
  return out;
}

inline bool same(const ImuReading& a, const ImuReading& b) {
  return a.arrival == b.arrival && a.device == b.device && a.counter == b.counter && a.gyro == b.gyro &&
         a.accel == b.accel;
}

/// Values that f32 holds exactly, in every protocol but MIP, which sends g.
inline ImuReading readingNumber(int i) {
  ImuReading reading;
  reading.device = Stamp{1'000'000'000 + 2'500'000LL * i};
  reading.counter = static_cast<std::uint64_t>(i);
  reading.gyro = {0.125 * (i % 16), -0.25, 0.5};
  reading.accel = {0.25, -0.5 * (i % 8), -9.8125};
  return reading;
}

inline Bytes encoded(ImuEncoder& encoder, const ImuReading& reading) {
  std::array<std::uint8_t, ImuEncoder::kLongestFrame> out = {};
  const std::size_t length = encoder.encode(reading, out);
  REQUIRE(length > 0);
  return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(length)};
}

}  // namespace swiftlet::test
