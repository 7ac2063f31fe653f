#include "drivers/dds/topic_camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/dds/topic_search.hpp"
#include "drivers/image/image_decoder.hpp"
#include "drivers/image/ros_encoding.hpp"

namespace swiftlet {
namespace {

constexpr Duration kPatienceInFlight = Duration::fromMilliseconds(100);
/// Messages that one call of next() skips at most: more than can wait.
constexpr int kMostLeftOut = 2 * TopicReader::kKeptImages;
/// A longer gap is reported as silence, not as missed frames.
constexpr double kLongestHole = 1;  // s
constexpr PixelFormat kPicture = {{"JPEG"}, PixelLayout::kJpeg};

bool isPicture(std::string_view topic) { return topic.ends_with("/compressed"); }

template <std::size_t kSize>
void copyInto(std::array<char, kSize>& to, std::string_view from) {
  to = {};
  from.copy(to.data(), kSize - 1);
}

}  // namespace

DeviceFault rawImageOf(const TopicImage& message, int width, int height, RawImage& image) {
  if (message.compressed) {
    if (message.data.empty()) return deviceFault(DeviceFaultKind::kGarbage, 0, "its images are empty");
    image = {message.data.data(), width, height, 0, kPicture, 0, message.data.size()};
    return {};
  }
  const int length = static_cast<int>(std::min<std::size_t>(message.encoding.size(), 32));
  const std::optional<PixelFormat> format = rosEncoding(message.encoding, message.big_endian);
  if (!format) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "its encoding is `%.*s`; docs/ros2.md lists the supported ones", length,
                       message.encoding.data());
  }
  if (message.width != static_cast<std::uint32_t>(width) ||
      message.height != static_cast<std::uint32_t>(height)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "%ux%u, but the calibration is for %dx%d",
                       message.width, message.height, width, height);
  }
  const auto row = static_cast<std::uint32_t>(format->rowBytes(width));
  if (message.step < row || message.step > static_cast<std::uint32_t>(kLargestMessage)) {
    return deviceFault(DeviceFaultKind::kGarbage, 0, "a step of %u bytes, but a row of `%.*s` has %u",
                       message.step, length, message.encoding.data(), row);
  }
  const std::uint64_t needed = static_cast<std::uint64_t>(message.step) * (message.height - 1) + row;
  if (message.data.size() < needed) {
    return deviceFault(DeviceFaultKind::kLossy, 0, "%zu bytes of data, expected %llu", message.data.size(),
                       static_cast<unsigned long long>(needed));
  }
  image = {message.data.data(), width, height, static_cast<int>(message.step), *format};
  return {};
}

TopicCamera::TopicCamera(TopicCameraSettings settings)
    : settings_(std::move(settings)),
      type_(isPicture(settings_.topic) ? TopicType::kCompressedImage : TopicType::kImage) {}

DeviceFault TopicCamera::prepare() {
  if (reader_.isOpen()) return {};
  std::string error;
  if (!domain_) domain_ = DdsDomain::open(settings_.network, error);
  if (!domain_ || !reader_.open(domain_, type_, settings_.topic, bell_, error)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "%s", error.c_str());
  }
  return {};
}

DeviceFault TopicCamera::open() {
  close();
  warning_count_ = 0;
  if (const DeviceFault fault = prepare(); !fault.ok()) return fault;
  const DeviceFault fault = waitForImage(opened_ ? kPatienceInFlight : settings_.patience);
  if (!fault.ok()) return fault;
  if (opened_) ++counters_.reopened;
  opened_ = open_ = true;
  bad_ = 0;
  return {};
}

DeviceFault TopicCamera::waitForImage(Duration patience) {
  const Stamp end = monotonicNow() + patience;
  DeviceFault last;
  RawImage image;
  Stamp stamp;
  int bad = 0;
  for (Stamp arrival = monotonicNow(); arrival < end;) {
    if (!takeMessage(image, stamp, arrival, last)) {
      bell_.wait(std::max(end - monotonicNow(), Duration{}));
      arrival = monotonicNow();
      continue;
    }
    if (last.ok() && type_ == TopicType::kCompressedImage) last = checkPicture(image);
    if (!last.ok()) {
      if (++bad >= kMostBad) break;
      continue;
    }
    facts_ = {};
    copyInto(facts_.driver, "ROS 2");
    copyInto(facts_.card, settings_.topic);
    facts_.format = image.format;
    facts_.width = settings_.width;
    facts_.height = settings_.height;
    facts_.stride = image.stride;
    facts_.exposure = settings_.exposure;
    facts_.event = StampEvent::kStartOfExposure;
    facts_.buffers = TopicReader::kKeptImages;
    return {};
  }
  if (!last.ok()) return last;
  const int publishers = reader_.publishers();
  if (publishers > 0) {
    return deviceFault(DeviceFaultKind::kSilent, 0, "%d publishers of %s, but no image", publishers,
                       settings_.topic.c_str());
  }
  return deviceFault(DeviceFaultKind::kMissing, 0, "%s",
                     missingTopic(domain_->publishedTopics(), rosName(type_), settings_.topic).c_str());
}

DeviceFault TopicCamera::checkPicture(const RawImage& image) const {
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(image.width) *
                                   static_cast<std::size_t>(image.height));
  ImageSize found;
  switch (
      ImageDecoder().decode({image.data, image.bytes}, {image.width, image.height}, pixels.data(), found)) {
    case DecodeResult::kOk:
      return {};
    case DecodeResult::kUnknownFormat:
      return deviceFault(DeviceFaultKind::kUnsupported, 0, "its images are neither JPEG nor PNG");
    case DecodeResult::kWrongSize:
      return deviceFault(DeviceFaultKind::kUnsupported, 0, "%dx%d, but the calibration is for %dx%d",
                         found.width, found.height, image.width, image.height);
    case DecodeResult::kDamaged:
      break;
  }
  return deviceFault(DeviceFaultKind::kGarbage, 0, "its images are damaged");
}

void TopicCamera::close() {
  if (!open_) return;
  open_ = false;
  lent_ = false;
  forgetLent();
}

bool TopicCamera::takeMessage(RawImage& image, Stamp& stamp, Stamp& arrival, DeviceFault& fault) {
  TopicImage message;
  for (int i = 0; i < kMostLeftOut; ++i) {
    if (!reader_.take(message)) {
      bell_.clear();
      if (!reader_.take(message)) return false;
    }
    if (stamps_.follow(settings_.read_clocks())) {
      remark_ = deviceFault(DeviceFaultKind::kClockSet, 0, "by %+.3f s", stamps_.step().seconds());
    }
    arrival = monotonicNow();
    switch (stamps_.map(message.stamp, arrival, stamp)) {
      case WallStamps::Result::kMapped:
        break;
      case WallStamps::Result::kUnsure:
        ++counters_.stale;
        continue;
      case WallStamps::Result::kWrongClock:
        ++counters_.wrong_clock;
        fault = deviceFault(DeviceFaultKind::kWrongClock, 0, "stamps are %.3f s before their arrival",
                            stamps_.farBy().seconds());
        return true;
    }
    if (newest_ && stamp <= *newest_) {
      ++counters_.stale;
      continue;
    }
    if (stamp > arrival) ++counters_.stamp_ahead;
    const double step = newest_ ? std::round((stamp - *newest_).seconds() * settings_.rate) : 1;
    newest_ = stamp;
    const auto passed = static_cast<std::uint64_t>(std::max(step, 1.0));
    sequence_ += passed;
    if (open_ && step <= kLongestHole * settings_.rate) counters_.missed += passed - 1;
    fault = rawImageOf(message, settings_.width, settings_.height, image);
    if (!fault.ok()) ++(fault.kind == DeviceFaultKind::kLossy ? counters_.too_short : counters_.damaged);
    return true;
  }
  return false;
}

DeviceFault TopicCamera::next(CapturedFrame& frame) {
  frame.release();
  if (!open_) return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for the device to return");
  if (lent_) return {};
  DeviceFault fault;
  for (int i = 0; i < kMostLeftOut; ++i) {
    if (!takeMessage(frame.image, frame.stamp, frame.arrival, fault)) break;
    if (fault.ok() &&
        !(frame.image.format == facts_.format && frame.image.format.layout == facts_.format.layout)) {
      fault = deviceFault(DeviceFaultKind::kChanged, 0, "its images changed from %s to %s",
                          facts_.format.letters.data(), frame.image.format.letters.data());
      bad_ = kMostBad;
    }
    if (!fault.ok()) {
      frame.image = {};
      if (++bad_ < kMostBad) continue;
      close();
      return fault;
    }
    bad_ = 0;
    frame.event = facts_.event;
    frame.sequence = sequence_;
    lent_ = true;
    lend(frame, 0);
    break;
  }
  counters_.lost = reader_.counters().lost;
  counters_.overrun = reader_.counters().overrun;
  return {};
}

bool TopicCamera::nextRemark(DeviceFault& remark) {
  if (!remark_) return false;
  remark = *std::exchange(remark_, std::nullopt);
  return true;
}

}  // namespace swiftlet
