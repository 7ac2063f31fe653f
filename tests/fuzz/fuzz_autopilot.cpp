// What is demanded of the link, whatever an autopilot sends:
// - poses go out at the rate, each later than the one before, as if nothing came;
// - every answer to TIMESYNC mirrors a request that came in, and none is answered twice;
// - what goes out is whole frames, and no more than a step may write.
// Each input is read as it is, and with the checksums of whole frames made right.

#include "tests/fuzz/fuzz_autopilot.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "drivers/device/byte_fields.hpp"
#include "drivers/mavlink/autopilot_link.hpp"
#include "firmware_host/inputs/devices/autopilot_dialogue.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr Stamp kLinkStart{1'000'000'000'000};
constexpr Duration kStep = Duration::fromMilliseconds(5);

struct Sent {
  std::size_t poses = 0, answers = 0, beats = 0;
  std::uint64_t newest = 0;
};

void hear(MavlinkParser& parser, std::span<const std::uint8_t> bytes, const std::vector<std::int64_t>& asked,
          Sent& sent) {
  demand(parser.feed(bytes, {}, {}) == bytes.size());
  std::size_t framed = 0;
  for (MavlinkFrame frame; parser.next(frame);) {
    ++framed;
    mavlink::Odometry pose;
    mavlink::Timesync answer;
    if (mavlink::read(frame, pose)) {
      demand(pose.time_usec > sent.newest && pose.quality == 100);
      sent.newest = pose.time_usec;
      ++sent.poses;
    } else if (mavlink::read(frame, answer)) {
      demand(answer.tc1 != 0);
      demand(std::ranges::find(asked, answer.ts1) != asked.end());
      ++sent.answers;
    } else {
      demand(frame.message == mavlink::Heartbeat::kId);
      ++sent.beats;
    }
  }
  demand(bytes.empty() || framed > 0);
}

/// What our own parser takes for requests: the link may answer these and no others.
std::vector<std::int64_t> requestsIn(const Bytes& bytes) {
  std::vector<std::int64_t> asked;
  MavlinkParser parser;
  for (std::span<const std::uint8_t> rest = bytes; !rest.empty();) {
    rest = rest.subspan(parser.feed(rest, {}, {}));
    for (MavlinkFrame frame; parser.next(frame);) {
      mavlink::Timesync request;
      if (mavlink::read(frame, request) && request.tc1 == 0) asked.push_back(request.ts1);
    }
  }
  return asked;
}

/// `piece(at)`: how many bytes come before the next step.
template <typename Piece>
void converse(const Bytes& bytes, Piece&& piece) {
  const std::vector<std::int64_t> asked = requestsIn(bytes);
  AutopilotLink link{AutopilotLinkSettings{}};
  MavlinkParser ours;
  Sent sent;
  NavState state;
  state.health = Health::kGood;
  constexpr int kLeast = 200;
  Stamp now = kLinkStart;
  std::size_t at = 0;
  int steps = 0;
  for (; at < bytes.size() || steps < kLeast; ++steps, now = now + kStep) {
    const std::size_t size = at < bytes.size() ? std::min(piece(at), bytes.size() - at) : 0;
    link.receive(std::span(bytes).subspan(at, size), now, {});
    at += size;
    state.stamp = now - kStep;
    std::array<std::uint8_t, AutopilotLink::kMostBytes> out;
    const std::size_t count = link.step(now, &state, Eigen::Vector3d::Zero(), out);
    demand(count <= out.size());
    hear(ours, std::span(out).first(count), asked, sent);
  }
  demand(link.received().bytes == bytes.size());
  demand(ours.counters().skipped_bytes == 0 && ours.counters().checksum_failures == 0);
  demand(sent.answers == link.counters().timesync_answers && sent.answers <= asked.size());
  // 40 poses in 200 steps of 5 ms, a heartbeat in each second.
  const auto wanted = static_cast<std::size_t>(steps) / 5;
  demand(sent.poses + 2 >= wanted && sent.poses <= wanted + 2);
  demand(sent.beats >= static_cast<std::size_t>(steps) / 200);
}

/// What is said to an autopilot that is the IMU: requests of the time at their pace, answers to its own, and
/// the rate of one of three messages.
template <typename Piece>
void converseAsImu(const Bytes& bytes, Piece&& piece) {
  constexpr double kRate = 200;
  constexpr int kLeast = 1000;
  const std::vector<std::int64_t> asked = requestsIn(bytes);
  ImuDecoder decoder(ImuProtocol::kMavlink);
  AutopilotDialogue dialogue(kRate);
  MavlinkParser ours;
  std::size_t answers = 0, requests = 0, commands = 0;
  Stamp now = kLinkStart;
  std::size_t at = 0;
  int steps = 0;
  for (; at < bytes.size() || steps < kLeast; ++steps, now = now + kStep) {
    const std::size_t size = at < bytes.size() ? std::min(piece(at), bytes.size() - at) : 0;
    demand(decoder.feed(std::span(bytes).subspan(at, size), now, {}) == size);
    at += size;
    for (ImuReading reading; decoder.next(reading);) {
      demand(reading.gyro.allFinite() && reading.accel.allFinite());
      demand(reading.mean_age >= Duration{} && reading.mean_age <= Duration::fromMilliseconds(3));
      static_cast<void>(dialogue.toHost(*reading.device));
    }
    for (TriggerEdge edge; decoder.nextEdge(edge);) demand(edge.arrival <= now);
    std::array<std::uint8_t, AutopilotDialogue::kMostBytes> out;
    const std::size_t count = dialogue.step(decoder, now, out);
    demand(count <= out.size() && ours.feed(std::span(out).first(count), now, {}) == count);
    for (MavlinkFrame frame; ours.next(frame);) {
      mavlink::Timesync time;
      mavlink::CommandLong command;
      if (mavlink::read(frame, time) && time.tc1 == 0) {
        demand(time.ts1 == now.ns);
        ++requests;
      } else if (frame.message == mavlink::Timesync::kId) {
        demand(std::ranges::find(asked, time.ts1) != asked.end());
        ++answers;
      } else {
        demand(mavlink::read(frame, command) && command.command == mavlink::CommandLong::kSetMessageInterval);
        constexpr float kShortest = 2500, kLongest = 5000;  // us, of twice the rate and of the rate
        demand(command.param[1] >= kShortest && command.param[1] <= kLongest);
        demand(command.param[0] == 105 || command.param[0] == 27 || command.param[0] == 26);
        ++commands;
      }
    }
  }
  demand(ours.counters().skipped_bytes == 0 && ours.counters().checksum_failures == 0);
  demand(answers <= asked.size());
  // One in 95 ms; a command at most each second, and one more for each return of an autopilot, 3 s apart.
  const auto wanted = static_cast<std::size_t>(steps) / 19;
  demand(requests >= wanted && requests <= wanted + 2);
  demand(commands <= 2 + static_cast<std::size_t>(steps) / 150);
}

Bytes withChecksums(Bytes bytes) {
  for (std::size_t at = 0; at < bytes.size();) {
    const std::span<std::uint8_t> rest = std::span(bytes).subspan(at);
    const MavlinkHeader header = readMavlinkHeader(rest);
    if (header.verdict != MavlinkHeader::Verdict::kRead || rest.size() < header.frame_length) {
      ++at;
      continue;
    }
    const std::uint8_t crc_extra = knownCrcExtra(header.message).value_or(7);
    const std::size_t end = header.payload_begin + header.payload_length;
    const std::span<std::uint8_t> frame = rest.first(header.frame_length);
    LittleFieldWriter(frame.subspan(end, 2)).u16(mavlinkChecksum(frame, header, crc_extra));
    at += header.frame_length;
  }
  return bytes;
}

void converseAll(const Bytes& bytes) {
  converse(bytes, [](std::size_t) { return std::size_t{4096}; });
  converse(bytes, [](std::size_t) { return std::size_t{40}; });
  converse(bytes, [&](std::size_t at) { return std::size_t{1} + bytes[at] % 61U; });
  converseAsImu(bytes, [](std::size_t) { return std::size_t{4096}; });
  converseAsImu(bytes, [&](std::size_t at) { return std::size_t{1} + bytes[at] % 61U; });
}

}  // namespace

void autopilotStream(std::string_view text) {
  // Longer inputs say nothing new and take time.
  constexpr std::size_t kLongest = 4096;
  const Bytes bytes(text.begin(),
                    text.begin() + static_cast<std::ptrdiff_t>(std::min(text.size(), kLongest)));
  converseAll(bytes);
  converseAll(withChecksums(bytes));
}

}  // namespace swiftlet::fuzz
