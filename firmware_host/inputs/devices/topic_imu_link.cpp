#include "firmware_host/inputs/devices/topic_imu_link.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "drivers/dds/topic_search.hpp"
#include "drivers/device/monotonic_now.hpp"

namespace swiftlet {
namespace {

constexpr Duration kLongInFlight = Duration::fromMilliseconds(100);

}  // namespace

TopicImuLink::TopicImuLink(TopicImuSettings settings) : settings_(std::move(settings)) {
  imu_.topic = settings_.topic;
  accel_.topic = settings_.accel_topic;
}

DeviceFault TopicImuLink::prepare() {
  std::string error;
  if (!domain_) domain_ = DdsDomain::open(settings_.network, error);
  for (Stream* stream : {&imu_, &accel_}) {
    if (stream->topic.empty() || stream->reader.isOpen()) continue;
    if (!domain_ || !stream->reader.open(domain_, TopicType::kImu, stream->topic, bell_, error)) {
      return deviceFault(DeviceFaultKind::kUnsupported, 0, "%s", error.c_str());
    }
  }
  return {};
}

DeviceFault TopicImuLink::open() {
  if (const DeviceFault fault = prepare(); !fault.ok()) return fault;
  const Stamp end = monotonicNow() + (opened_ ? kLongInFlight : settings_.patience);
  bad_ = 0;
  open_ = true;
  const std::uint64_t before = samples_;
  while (samples_ == before) {
    const Stamp now = monotonicNow();
    if (now >= end) {
      open_ = false;
      return silent();
    }
    bell_.wait(end - now);
    if (const DeviceFault fault = receive(monotonicNow()); !fault.ok()) {
      return fault;
    }
    for (ImuReading reading; next(reading);) {
    }
  }
  opened_ = true;
  return {};
}

DeviceFault TopicImuLink::silent() const {
  for (const Stream* stream : {&imu_, &accel_}) {
    if (stream->topic.empty() || stream->reader.publishers() > 0) continue;
    return deviceFault(
        DeviceFaultKind::kMissing, 0, "%s",
        missingTopic(domain_->publishedTopics(), rosName(TopicType::kImu), stream->topic).c_str());
  }
  const AccelAtGyro::Counters& joined = joined_.counters();
  return deviceFault(
      DeviceFaultKind::kSilent, 0, "%llu messages received, %llu gyroscope samples without accelerometer",
      static_cast<unsigned long long>(came_), static_cast<unsigned long long>(joined.unpaired));
}

void TopicImuLink::discard() {
  static_cast<void>(receive(monotonicNow()));
  for (ImuReading reading; next(reading);) {
  }
  missing_ = 0;
}

DeviceFault TopicImuLink::judge(const TopicImu& message) const {
  if (!message.gyro.allFinite() || !message.accel.allFinite()) {
    return deviceFault(DeviceFaultKind::kGarbage, 0, "values that are not finite");
  }
  // Exactly zero: drivers fill in fields that they do not measure with zeros.
  if (!apart() && message.accel.isZero(0)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "no acceleration in %s: set imu_link.accel_topic to the accelerometer's topic",
                       settings_.topic.c_str());
  }
  return {};
}

DeviceFault TopicImuLink::takeOne(Stream& stream, const TopicImu& message) {
  ++came_;
  if (const DeviceFault fault = judge(message); !fault.ok()) {
    ++damaged_;
    return fault;
  }
  if (stream.stamps.follow(settings_.read_clocks())) {
    remark_ = deviceFault(DeviceFaultKind::kClockSet, 0, "by %+.3f s", stream.stamps.step().seconds());
  }
  AccelAtGyro::Sample sample;
  sample.arrival = now_;
  switch (stream.stamps.map(message.stamp, now_, sample.stamp)) {
    case WallStamps::Result::kMapped:
      break;
    case WallStamps::Result::kUnsure:
      ++unsure_;
      return {};
    case WallStamps::Result::kWrongClock:
      ++wrong_clock_;
      return deviceFault(DeviceFaultKind::kWrongClock, 0, "stamps are %.3f s before their arrival",
                         stream.stamps.farBy().seconds());
  }
  if (&stream == &imu_) {
    countHole(sample.stamp);
    sample.value = message.gyro;
    joined_.addGyro(sample);
  }
  if (&stream == &accel_ || !apart()) {
    sample.value = message.accel;
    joined_.addAccel(sample);
  }
  return {};
}

void TopicImuLink::countHole(Stamp stamp) {
  if (newest_ && stamp > *newest_ && settings_.rate > 0) {
    const double steps = std::round((stamp - *newest_).seconds() * settings_.rate);
    // A longer gap is a silence, which is reported as such.
    constexpr double kLongestHole = 1;  // s
    if (steps > 1 && steps <= kLongestHole * settings_.rate)
      missing_ += static_cast<std::uint64_t>(steps) - 1;
  }
  newest_ = newest_ ? std::max(*newest_, stamp) : stamp;
}

DeviceFault TopicImuLink::receive(Stamp now) {
  now_ = now;
  bell_.clear();
  for (Stream* stream : {&imu_, &accel_}) {
    TopicImu message;
    for (int i = 0; i < TopicReader::kKeptSamples && stream->reader.take(message); ++i) {
      const DeviceFault fault = takeOne(*stream, message);
      bad_ = fault.ok() ? 0 : bad_ + 1;
      if (bad_ < kMostBad) continue;
      open_ = false;
      return fault;
    }
  }
  return {};
}

bool TopicImuLink::next(ImuReading& reading) {
  if (!joined_.next(now_, reading)) return false;
  ++samples_;
  return true;
}

bool TopicImuLink::nextRemark(DeviceFault& remark) {
  if (!remark_) return false;
  remark = *std::exchange(remark_, std::nullopt);
  return true;
}

std::string TopicImuLink::stream() const {
  return apart() ? "separate gyroscope and accelerometer, the latter interpolated" : "";
}

nlohmann::ordered_json TopicImuLink::counters() const {
  const AccelAtGyro::Counters& joined = joined_.counters();
  TopicCounters topics = imu_.reader.counters();
  topics.lost += accel_.reader.counters().lost;
  topics.overrun += accel_.reader.counters().overrun + joined.overrun;
  return {{"messages", came_},           {"samples", samples_},
          {"missing_samples", missing_}, {"stale", joined.stale / (apart() ? 1 : 2) + unsure_},
          {"unpaired", joined.unpaired}, {"damaged", damaged_},
          {"wrong_clock", wrong_clock_}, {"lost", topics.lost},
          {"overrun", topics.overrun},   {"clock_steps", imu_.stamps.steps()}};
}

}  // namespace swiftlet
