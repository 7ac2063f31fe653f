#include "firmware_host/inputs/devices/autopilot_dialogue.hpp"

namespace swiftlet {
namespace {

/// About as often as PX4 asks; 3 % of a link at 57600 Bd. Not a multiple of usual pose periods: otherwise
/// each request would follow a pose on the same wire and be 3 ms late, which adds half of that to every
/// stamp.
constexpr Duration kAskPeriod = Duration::fromMilliseconds(93);

}  // namespace

std::size_t AutopilotDialogue::step(ImuDecoder& decoder, Stamp now, std::span<std::uint8_t, kMostBytes> out) {
  std::size_t length = 0;
  const auto send = [&](const auto& message) {
    length += mavlink::write(sender_, message, out.subspan(length));
  };
  // Readings are in their sender's clock, so on a link with several systems only the sender is asked for its
  // clock.
  if (const auto& source = decoder.mavlinkSource()) {
    if (source->system != system_ || source->component != component_) exchange_ = TwoWayClockMap();
    system_ = source->system;
    component_ = source->component;
  }
  std::size_t answers = 0;
  for (ReceivedMavlink received; decoder.nextMavlink(received);) {
    if (const auto* heartbeat = std::get_if<mavlink::Heartbeat>(&received.message)) {
      if (heartbeat->autopilot != mavlink::Heartbeat::kNoAutopilot) {
        px4_ = heartbeat->autopilot == mavlink::Heartbeat::kPx4;
      }
      stream_.hear(*heartbeat, received.system, received.component, received.arrival);
    } else if (const auto* ack = std::get_if<mavlink::CommandAck>(&received.message)) {
      stream_.hear(*ack, received.system);
    } else if (const auto* time = std::get_if<mavlink::Timesync>(&received.message)) {
      if (time->tc1 == 0 && answers < kMostAnswers) {
        ++answers;
        send(mavlink::Timesync{now.ns, time->ts1, received.system, received.component});
      } else if (time->tc1 != 0 && time->ts1 == asked_.ns && received.system == system_ &&
                 received.component == component_) {
        static_cast<void>(exchange_.add({asked_, Stamp{time->tc1}, received.arrival}));
      }
    }
  }
  answers_ += answers;
  stream_.count(decoder.counters().samples - samples_);
  samples_ = decoder.counters().samples;
  if (const auto command = stream_.step(now)) {
    ++requests_;
    send(*command);
  }
  decoder.takeMavlink(stream_.message());
  sender_.system = stream_.system().value_or(sender_.system);
  if (now - asked_ >= kAskPeriod) {
    asked_ = now;
    send(mavlink::Timesync{0, asked_.ns, system_, component_});
  }
  return length;
}

void AutopilotDialogue::restart() {
  exchange_ = TwoWayClockMap();
  asked_ = {};
}

std::optional<Stamp> AutopilotDialogue::toHost(Stamp device) const {
  if (!exchange_.usable()) return std::nullopt;
  return exchange_.toHost(device);
}

}  // namespace swiftlet
