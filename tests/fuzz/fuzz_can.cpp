#include "tests/fuzz/fuzz_can.hpp"

#include <algorithm>
#include <vector>

#include "drivers/can/raw_imu.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

void demandSane(const RawImuDecoder& decoder, const ImuReading& reading) {
  demand(reading.gyro.allFinite() && reading.accel.allFinite());
  demand(reading.counter.has_value());
  demand(!reading.device || reading.device->ns > 0);
  demand(decoder.node() != 0);
  demand(decoder.counters().readings <= decoder.transfers().transfers);
}

void frames(const Bytes& bytes) {
  RawImuDecoder decoder;
  ImuReading reading;
  Stamp now;
  std::uint64_t counter = 0;
  for (std::size_t at = 0; at + 2 <= bytes.size();) {
    const std::uint32_t kind = bytes[at];
    CanFrame frame;
    frame.fd = (kind & 1U) != 0;
    const std::uint32_t type = (kind & 8U) != 0 ? kGlobalTimeSyncType : rawImuType().id;
    frame.id = type << 8U | (1U + (kind >> 1U & 3U));
    // One in sixteen after the timeout.
    now = now + ((kind >> 4U) == 15U ? Duration::fromMilliseconds(2500) : Duration{300'000});
    frame.arrival = now;
    const std::size_t most = frame.fd ? CanFrame::kMaxBytes : CanFrame::kClassicBytes;
    const std::size_t size = std::min({static_cast<std::size_t>(bytes[at + 1]), most, bytes.size() - at - 2});
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at + 2), size, frame.data.begin());
    frame.size = static_cast<std::uint8_t>(size);
    at += 2 + size;
    if (!decoder.take(frame, reading)) continue;
    demandSane(decoder, reading);
    demand(*reading.counter >= counter);
    counter = *reading.counter;
  }
}

void payload(const Bytes& bytes, bool fd) {
  DroneCanFrames sent;
  if (!encodeTransfer(rawImuType(), 16, 42, 5, fd, bytes, sent)) return;
  demand(sent.count >= 1 && sent.count <= sent.frames.size());
  DroneCanReassembler reassembler(rawImuType());
  DroneCanTransfer transfer;
  bool complete = false;
  for (std::size_t i = 0; i < sent.count; ++i) {
    demand(!complete);
    complete = reassembler.take(sent.frames[i], transfer);
  }
  demand(complete && transfer.payload.size() >= bytes.size() && transfer.payload.size() < bytes.size() + 16);
  demand(std::equal(bytes.begin(), bytes.end(), transfer.payload.begin()));
  RawImu imu;
  if (!decodeRawImu(transfer.payload, fd, imu)) return;
  std::array<std::uint8_t, kMaxRawImuBytes> again = {};
  const std::size_t size = encodeRawImu(imu, fd, again);
  demand(size <= transfer.payload.size());
  RawImu twin;
  demand(decodeRawImu({again.data(), size}, fd, twin));
  demand(twin.stamp_us == imu.stamp_us && twin.covariance_count == imu.covariance_count);
  RawImuDecoder decoder;
  ImuReading reading;
  for (std::size_t i = 0; i < sent.count; ++i) {
    if (decoder.take(sent.frames[i], reading)) demandSane(decoder, reading);
  }
}

}  // namespace

void dronecan(std::string_view text) {
  const Bytes bytes(text.begin(), text.end());
  frames(bytes);
  payload(bytes, false);
  payload(bytes, true);
}

}  // namespace swiftlet::fuzz
