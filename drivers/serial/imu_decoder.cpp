#include "drivers/serial/imu_decoder.hpp"

#include <algorithm>
#include <array>

namespace swiftlet {
namespace {

constexpr std::array<std::string_view, kImuProtocolCount> kNames = {"vectornav", "xsens", "mip", "mavlink",
                                                                    "bridge"};
constexpr std::uint64_t kNsPerMicrosecond = 1'000;

}  // namespace

std::string_view name(ImuProtocol protocol) { return kNames[static_cast<std::size_t>(protocol)]; }

std::optional<ImuProtocol> imuProtocol(std::string_view name) {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return static_cast<ImuProtocol>(i);
  }
  return {};
}

bool ImuDecoder::next(ImuReading& reading) {
  const auto check_here = [this](std::span<const std::uint8_t> bytes) { return check(bytes); };
  StampedFrame frame;
  while (buffer_.next(check_here, frame, counters_)) {
    InertialFrame content;
    read(frame, content);
    for (TriggerEdge edge : content.edges) {
      edge.arrival = frame.arrival;
      ++(edges_.push(edge) ? counters_.edges : counters_.events_refused);
    }
    if (give(content, frame.arrival, reading)) return true;
  }
  return false;
}

bool ImuDecoder::give(const InertialFrame& content, Stamp arrival, ImuReading& reading) {
  if (!content.known) {
    ++counters_.unknown_kinds;
    return false;
  }
  const bool has_both = content.gyro && content.accel;
  if (!content.in_range || (has_both && !(content.gyro->allFinite() && content.accel->allFinite()))) {
    ++counters_.not_finite;
    return false;
  }
  if (!has_both) {
    ++counters_.without_sample;
    return false;
  }
  const SampleGaps::Step step = gaps_.step(content.device, content.counter);
  counters_.missing_samples += step.missing;
  if (step.went_back) ++counters_.clock_steps;
  ++counters_.samples;
  reading = {arrival, content.device, content.counter, *content.gyro, *content.accel, content.mean_age};
  return true;
}

FrameCheck ImuDecoder::check(std::span<const std::uint8_t> bytes) {
  switch (protocol_) {
    case ImuProtocol::kVectorNav:
      return VectorNav::check(bytes);
    case ImuProtocol::kXsens:
      return Xsens::check(bytes);
    case ImuProtocol::kMip:
      return Mip::check(bytes);
    case ImuProtocol::kMavlink:
      return link_.check(bytes, counters_);
    case ImuProtocol::kBridge:
      return Bridge::check(bytes);
  }
  return {};
}

void ImuDecoder::read(const StampedFrame& frame, InertialFrame& content) {
  switch (protocol_) {
    case ImuProtocol::kVectorNav:
      return vectornav_.read(frame.bytes, content);
    case ImuProtocol::kXsens:
      return xsens_.read(frame.bytes, content);
    case ImuProtocol::kMip:
      return Mip::read(frame.bytes, content);
    case ImuProtocol::kMavlink:
      return readMavlink(frame, content);
    case ImuProtocol::kBridge:
      return bridge_.read(frame.bytes, content);
  }
}

void ImuDecoder::readMavlink(const StampedFrame& bytes, InertialFrame& content) {
  MavlinkFrame frame;
  unpackMavlink(bytes, frame);
  link_.count(frame, counters_);
  mavlink::CameraTrigger trigger;
  mavlink::Timesync timesync;
  mavlink::Heartbeat heartbeat;
  mavlink::CommandAck ack;
  const auto keep = [&](const auto& message) {
    if (!received_.push({frame.arrival, frame.system, frame.component, message})) ++counters_.events_refused;
  };
  if (mavlink::read(frame, timesync)) {
    keep(timesync);
  } else if (mavlink::read(frame, heartbeat)) {
    if (heartbeat.autopilot == mavlink::Heartbeat::kPx4) px4_ = frame.system;
    keep(heartbeat);
  } else if (mavlink::read(frame, ack)) {
    keep(ack);
  } else if (mavlink::read(frame, trigger)) {
    if (source_ && source_->system != frame.system) return;
    const auto time = stampOf(trigger.time_usec, kNsPerMicrosecond);
    content.in_range = time.has_value();
    TriggerEdge edge;
    edge.counter = mavlink_triggers_.unwrap(trigger.seq);
    if (time) edge.device = *time;
    if (time) (void)content.edges.tryPushBack(edge);
  } else if (frame.message == mavlink::HighresImu::kId && frame.message == mavlink_message_) {
    readHighresImu(frame, content);
  } else if (frame.message == mavlink_message_) {
    readScaledImu(frame, content);
  } else {
    content.known = false;
  }
}

void ImuDecoder::readHighresImu(const MavlinkFrame& frame, InertialFrame& content) {
  mavlink::HighresImu imu;
  (void)mavlink::read(frame, imu);
  constexpr unsigned kBoth = mavlink::HighresImu::kAccelUpdated | mavlink::HighresImu::kGyroUpdated;
  if ((imu.fields_updated & kBoth) != kBoth) return;
  if (!isOurs(frame, imu.id)) return;
  content.gyro = imu.gyro.cast<double>();
  content.accel = imu.accel.cast<double>();
  content.device = stampOf(imu.time_usec, kNsPerMicrosecond);
  content.in_range = content.device.has_value();
  if (px4_ == frame.system) content.mean_age = meanAge();
}

void ImuDecoder::readScaledImu(const MavlinkFrame& frame, InertialFrame& content) {
  mavlink::ScaledImu imu;
  if (!mavlink::read(frame, imu) || !isOurs(frame, imu.id)) return;
  content.gyro = imu.gyro.cast<double>() * mavlink::ScaledImu::kRadPerSecond;
  content.accel = imu.accel.cast<double>() * mavlink::ScaledImu::kMetresPerSecond2;
  content.device = stampOf(imu.time_usec, kNsPerMicrosecond);
  content.in_range = content.device.has_value();
}

/// Accepts only the first sender and sensor.
bool ImuDecoder::isOurs(const MavlinkFrame& frame, std::uint8_t sensor) {
  const MavlinkImuSource sender{frame.system, frame.component, sensor};
  if (!source_) source_ = sender;
  return source_ == sender;
}

/// PX4's readings are means over 1 / IMU_INTEG_RATE, 5 ms by default, stamped at the end. If the stream skips
/// some means, its steps are longer than the interval; at a higher IMU_INTEG_RATE they are shorter.
Duration ImuDecoder::meanAge() const {
  constexpr Duration kUsualInterval = Duration::fromMilliseconds(5);
  return {std::min(gaps_.usualStep().value_or(kUsualInterval).ns, kUsualInterval.ns) / 2};
}

void ImuDecoder::takeMavlink(std::uint32_t message) {
  if (message == mavlink_message_) return;
  mavlink_message_ = message;
  source_.reset();
  gaps_.forget();
}

void ImuDecoder::restart() {
  buffer_.clear(counters_);
  vectornav_.forget();
  xsens_.forget();
  bridge_.forget();
  link_.forgetSenders();
  mavlink_triggers_.forget();
  gaps_.forget();
  source_.reset();
}

}  // namespace swiftlet
