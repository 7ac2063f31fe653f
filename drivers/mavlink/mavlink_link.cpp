#include "drivers/mavlink/mavlink_link.hpp"

#include "drivers/device/crc16.hpp"

namespace swiftlet {

FrameCheck MavlinkLink::check(std::span<const std::uint8_t> bytes, StreamCounters& counters) {
  const MavlinkHeader header = readMavlinkHeader(bytes);
  switch (header.verdict) {
    case MavlinkHeader::Verdict::kNotHere:
      return {FrameVerdict::kNotHere, 0};
    case MavlinkHeader::Verdict::kUnknownFlags:
      ++counters.unknown_flags;
      return {FrameVerdict::kNotHere, 0};
    case MavlinkHeader::Verdict::kIncomplete:
      return {FrameVerdict::kIncomplete, 0};
    case MavlinkHeader::Verdict::kRead:
      break;
  }
  if (bytes.size() < header.frame_length) return {FrameVerdict::kIncomplete, 0};
  const auto frame = bytes.first(header.frame_length);
  FrameVerdict verdict = FrameVerdict::kBadChecksum;
  if (const auto crc_extra = knownCrcExtra(header.message)) {
    if (mavlinkChecksum(frame, header, *crc_extra) == carriedChecksum(frame, header))
      verdict = FrameVerdict::kWhole;
  } else {
    verdict = checkUnknown(frame, header);
  }
  return {verdict, header.frame_length};
}

FrameVerdict MavlinkLink::checkUnknown(std::span<const std::uint8_t> frame, const MavlinkHeader& header) {
  const std::uint16_t before = mavlinkChecksum(frame, header);
  const std::uint16_t carried = carriedChecksum(frame, header);
  // The last CRC step maps the 256 values to different results, so at most one fits.
  for (unsigned value = 0; value < 256; ++value) {
    const auto crc_extra = static_cast<std::uint8_t>(value);
    if (crc16Mcrf4xx(before, {&crc_extra, 1}) != carried) continue;
    return hasLearned(header.message, crc_extra) ? FrameVerdict::kWhole : FrameVerdict::kNotHere;
  }
  return FrameVerdict::kBadChecksum;
}

bool MavlinkLink::hasLearned(std::uint32_t message, std::uint8_t crc_extra) {
  for (Learned& learned : learned_) {
    if (!learned.used || learned.message != message) continue;
    if (learned.crc_extra == crc_extra) return true;
    learned.crc_extra = crc_extra;
    return false;
  }
  learned_[next_learned_] = {message, crc_extra, true};
  next_learned_ = (next_learned_ + 1) % learned_.size();
  return false;
}

void MavlinkLink::count(const MavlinkFrame& frame, StreamCounters& counters) {
  if (frame.is_signed) ++counters.signed_messages;
  for (std::size_t i = 0; i < source_count_; ++i) {
    Source& source = sources_[i];
    if (source.system != frame.system || source.component != frame.component) continue;
    counters.lost_messages += static_cast<std::uint8_t>(frame.sequence - source.sequence - 1);
    source.sequence = frame.sequence;
    return;
  }
  if (source_count_ < sources_.size())
    sources_[source_count_++] = {frame.system, frame.component, frame.sequence};
}

bool MavlinkParser::next(MavlinkFrame& frame) {
  const auto check = [this](std::span<const std::uint8_t> bytes) { return link_.check(bytes, counters_); };
  StampedFrame bytes;
  if (!buffer_.next(check, bytes, counters_)) return false;
  unpackMavlink(bytes, frame);
  link_.count(frame, counters_);
  return true;
}

void MavlinkParser::restart() {
  buffer_.clear(counters_);
  link_.forgetSenders();
}

}  // namespace swiftlet
