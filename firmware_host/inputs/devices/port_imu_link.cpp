#include "firmware_host/inputs/devices/serial_imu_link.hpp"

#include <nlohmann/json.hpp>

#include "firmware_host/inputs/devices/device_times.hpp"

namespace swiftlet {
namespace {

/// As PX4 asks: 3 % of a link at 57600 Bd.
constexpr Duration kAskPeriod = Duration::fromMilliseconds(100);
/// A port that takes no bytes for longer drops the request; the next one comes.
constexpr Duration kWriteTime = Duration::fromMilliseconds(2);
/// Reads that empty the kernel's buffer, of 64 kB at the most.
constexpr int kMostDiscarded = 64;
/// Of one round: an autopilot asks ten times a second.
constexpr int kMostAnswers = 4;

}  // namespace

SerialImuLink::SerialImuLink(const ImuLinkGroup& settings)
    : port_(SerialSettings{settings.device, static_cast<unsigned>(settings.baud)}),
      decoder_(imuProtocol(settings.protocol).value_or(ImuProtocol::kBridge)) {}

DeviceFault SerialImuLink::open() {
  decoder_.restart();
  exchange_ = TwoWayClockMap();
  return port_.reopen();
}

void SerialImuLink::discard() {
  std::size_t count = 1;
  Stamp read_at;
  for (int i = 0; i < kMostDiscarded && count > 0; ++i) static_cast<void>(port_.read(bytes_, count, read_at));
  decoder_.restart();
}

DeviceFault SerialImuLink::receive(Stamp now) {
  std::size_t count = 0;
  Stamp read_at;
  if (const DeviceFault fault = port_.read(bytes_, count, read_at); !fault.ok()) {
    port_.close();
    return fault;
  }
  // All of it fits: the decoder has been asked until it had no more.
  static_cast<void>(decoder_.feed(std::span(bytes_).first(count), read_at, port_.byteTime()));
  return decoder_.protocol() == ImuProtocol::kMavlink ? exchangeClocks(now) : DeviceFault{};
}

DeviceFault SerialImuLink::exchangeClocks(Stamp now) {
  ReceivedTimesync received;
  int answers = 0;
  while (decoder_.nextTimesync(received)) {
    const mavlink::Timesync& message = received.message;
    if (message.tc1 == 0) {
      if (++answers > kMostAnswers) continue;
      const mavlink::Timesync answer{hostNow().ns, message.ts1, received.system, received.component};
      if (const DeviceFault fault = sendTimesync(answer); !fault.ok()) return fault;
    } else if (message.ts1 == asked_.ns) {
      static_cast<void>(exchange_.add({asked_, Stamp{message.tc1}, received.arrival}));
    }
  }
  if (now - asked_ < kAskPeriod) return {};
  asked_ = hostNow();
  return sendTimesync({0, asked_.ns, 0, 0});
}

DeviceFault SerialImuLink::sendTimesync(const mavlink::Timesync& message) {
  std::array<std::uint8_t, kLongestMavlinkFrame> frame;
  const std::size_t length = mavlink::write(sender_, message, frame);
  const DeviceFault fault = port_.write(std::span(frame).first(length), kWriteTime);
  // A full port loses a request and no more.
  return fault.kind == DeviceFaultKind::kUnplugged ? fault : DeviceFault{};
}

std::optional<Stamp> SerialImuLink::toHost(Stamp device) const {
  if (!exchange_.usable()) return std::nullopt;
  return exchange_.toHost(device);
}

nlohmann::ordered_json SerialImuLink::counters() const {
  const StreamCounters& c = decoder_.counters();
  nlohmann::ordered_json json = {{"bytes", c.bytes},
                                 {"skipped_bytes", c.skipped_bytes},
                                 {"checksum_failures", c.checksum_failures},
                                 {"frames", c.frames},
                                 {"unknown_kinds", c.unknown_kinds},
                                 {"not_finite", c.not_finite},
                                 {"missing_samples", c.missing_samples},
                                 {"samples", c.samples}};
  if (const std::optional<SerialErrors> errors = port_.errors()) {
    json["overruns"] = errors->overrun + errors->buffer_overrun;
    json["framing_errors"] = errors->framing;
  }
  return json;
}

}  // namespace swiftlet
