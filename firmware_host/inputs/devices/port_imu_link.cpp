#include "firmware_host/inputs/devices/port_imu_link.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Enough reads to empty the kernel's buffer: at most 64 kB on a serial port, some hundred datagrams on UDP.
constexpr int kMostDiscarded = 1000;
/// Most datagrams per millisecond, about 0.2 ms of work. More is a flood, which must not occupy the highest
/// priority.
constexpr int kMostDatagrams = 64;
constexpr Duration kFloodWindow = Duration::fromMilliseconds(1);

}  // namespace

PortImuLink::PortImuLink(const ImuLinkGroup& settings, double rate, LinkOutbox* outbox)
    : port_(settings.device, static_cast<unsigned>(settings.baud), "imu_link.device"),
      decoder_(imuProtocol(settings.protocol).value_or(ImuProtocol::kBridge)),
      dialogue_(rate),
      setup_(rate),
      outbox_(outbox) {}

DeviceFault PortImuLink::open() {
  dialogue_.restart();
  const DeviceFault fault = port_.open();
  if (fault.ok()) setup_.run(port_, decoder_);
  decoder_.restart();
  return fault;
}

bool PortImuLink::restart() {
  // The dialogue requests an autopilot's stream again while the link is open; the link may also carry poses.
  if (isMavlink()) return false;
  static_cast<void>(close({}));
  return true;
}

void PortImuLink::discard() {
  std::size_t count = 1;
  Stamp read_at;
  for (int i = 0; i < kMostDiscarded && count > 0; ++i) static_cast<void>(port_.read(bytes_, count, read_at));
  decoder_.restart();
}

DeviceFault PortImuLink::close(const DeviceFault& fault) {
  if (outbox_ != nullptr) outbox_->attend(false);
  port_.close();
  return fault;
}

DeviceFault PortImuLink::receive(Stamp /*now*/) {
  std::size_t count = 0;
  Stamp read_at;
  if (const DeviceFault fault = port_.read(bytes_, count, read_at); !fault.ok()) return close(fault);
  // All bytes fit: the decoder was emptied before.
  static_cast<void>(decoder_.feed(std::span(bytes_).first(count), read_at, port_.byteTime()));
  if (port_.isUdp() && count > 0) pauseInFlood(read_at);
  return {};
}

void PortImuLink::pauseInFlood(Stamp read_at) {
  if (read_at - window_ >= kFloodWindow) {
    window_ = read_at;
    datagrams_ = 0;
  }
  if (++datagrams_ >= kMostDatagrams) sleepFor(kFloodWindow);
}

DeviceFault PortImuLink::judge(const DeviceFault& fault) {
  if (fault.ok()) return {};
  ++refused_;
  // A full port loses this message only.
  return fault.kind == DeviceFaultKind::kUnplugged ? close(fault) : DeviceFault{};
}

DeviceFault PortImuLink::send() {
  if (!isMavlink() || !port_.isOpen()) return {};
  std::array<std::uint8_t, AutopilotDialogue::kMostBytes> said;
  const std::size_t length = dialogue_.step(decoder_, monotonicNow(), said);
  if (length > 0) {
    if (const DeviceFault fault = judge(port_.write(std::span(said).first(length))); !fault.ok())
      return fault;
  }
  if (outbox_ == nullptr) return {};
  outbox_->tellPx4(dialogue_.px4());
  outbox_->tellByteTime(port_.byteTime());
  outbox_->hush();
  if (!outbox_->attended()) {
    // Drop messages queued while the link was down.
    while (outbox_->front() != nullptr) outbox_->pop();
    outbox_->attend(true);
  }
  // Only while the port holds nothing back. If it has no room, the outbox fills up, which the sender notices.
  while (const LinkOutbox::Bytes* bytes = port_.flush() ? outbox_->front() : nullptr) {
    const DeviceFault fault = judge(port_.write(bytes->used()));
    outbox_->pop();
    if (!fault.ok()) return fault;
    ++sent_;
  }
  return {};
}

std::optional<Stamp> PortImuLink::toHost(Stamp device) const { return dialogue_.toHost(device); }

bool PortImuLink::nextRemark(DeviceFault& remark) {
  return setup_.nextWarning(remark) || dialogue_.stream().nextRemark(remark);
}

std::string PortImuLink::stream() const {
  const ImuStreamRequest& stream = dialogue_.stream();
  if (!isMavlink()) return setup_.text();
  if (stream.asked() <= 0) return "no HEARTBEAT from an autopilot: no stream requested";
  const std::string answer = !stream.result() ? "no answer"
                             : *stream.result() == mavlink::CommandAck::kAccepted
                                 ? "accepted"
                                 : fmt::format("refused with MAV_RESULT {}", *stream.result());
  return fmt::format("{}: {:.0f} Hz requested, {}, {:.0f} Hz received", stream.messageName(), stream.asked(),
                     answer, stream.seen());
}

nlohmann::ordered_json PortImuLink::counters() const {
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
  if (isMavlink()) {
    json["message"] = dialogue_.stream().messageName();
    json["asked_hz"] = dialogue_.stream().asked();
    json["requests"] = dialogue_.requests();
    json["lost_messages"] = c.lost_messages;
    json["timesync_answers"] = dialogue_.answers();
    json["writes_refused"] = refused_;
  }
  if (outbox_ != nullptr) json["sent_for_autopilot"] = sent_;
  return json;
}

}  // namespace swiftlet
