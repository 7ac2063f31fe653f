#include "drivers/v4l2/camera_device.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/v4l2/camera_offers.hpp"
#include "drivers/v4l2/stamp_event.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kMinBuffers = 4;   // one being filled, one waiting, two lent to the pipeline
constexpr std::size_t kFewestBuffers = 2;  // with one, every second frame would be missed
// When a device's counter wraps or restarts, the difference is near 2^32: not a gap.
constexpr std::uint32_t kRestart = 1U << 31U;
constexpr double kRateTolerance = 0.005;        // relative; drivers round intervals to 1 us
constexpr std::uint32_t kRateNumerator = 1000;  // mHz resolution of rates
constexpr std::size_t kOfferBytes = 140;        // leaves room for the other text of a fault

std::uint32_t code(std::string_view letters) {
  return v4l2_fourcc(static_cast<std::uint32_t>(letters[0]), static_cast<std::uint32_t>(letters[1]),
                     static_cast<std::uint32_t>(letters[2]), static_cast<std::uint32_t>(letters[3]));
}

template <std::size_t kSize>
void copyText(const char* text, std::array<char, kSize>& out) {
  std::snprintf(out.data(), out.size(), "%s", text);
}

}  // namespace

void CameraDeviceSettings::setPath(const char* text) { copyText(text, path); }
void CameraDeviceSettings::setFormat(const char* text) { copyText(text, format); }

DeviceFault CameraDevice::open() {
  shut();
  warning_count_ = 0;
  facts_ = {};
  DeviceFault fault = node_.open(settings_.path.data(), VideoNode::Role::kCapture);
  if (fault.ok()) fault = negotiate();
  if (!fault.ok()) return closedBy(fault);
  if (opened_) ++counters_.reopened;
  opened_ = true;
  return fault;
}

void CameraDevice::shut() {
  controls_ = {};
  sensor_.close();
  node_.close();
  forgetLent();
  sequence_known_ = false;
}

DeviceFault CameraDevice::negotiate() {
  describeDevice();
  DeviceFault fault = chooseFormat();
  if (!fault.ok()) return fault;
  findControls();
  if (settings_.exposure) warn(controls_.setExposure(*settings_.exposure));
  if (settings_.gain) warn(controls_.setGain(*settings_.gain));
  facts_.exposure = controls_.exposure();
  facts_.gain = controls_.gain();
  fault = setBuffers();
  if (fault.ok()) fault = node_.start();
  return fault;
}

void CameraDevice::findControls() {
  controls_ = CameraControls(node_, facts_.width, facts_.card.data());
  if (controls_.exposes() || !sensor_.openBefore(node_.fd())) return;
  const CameraControls of_sensor(sensor_, sensor_.width(), sensor_.name());
  if (of_sensor.exposes()) controls_ = of_sensor;
}

DeviceFault CameraDevice::setExposure(const ExposureSetting& setting) {
  if (!isOpen())
    return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for the device to return");
  return controls_.set(setting);
}

void CameraDevice::describeDevice() {
  v4l2_capability capability = {};
  if (node_.call(VIDIOC_QUERYCAP, &capability) != 0) return;
  copyText(reinterpret_cast<const char*>(capability.driver), facts_.driver);
  first_data_ = stampsFirstData(facts_.driver.data());
  copyText(reinterpret_cast<const char*>(capability.card), facts_.card);
  copyText(reinterpret_cast<const char*>(capability.bus_info), facts_.bus);
}

DeviceFault CameraDevice::chooseFormat() {
  const std::string_view asked = settings_.format.data();
  const std::optional<PixelFormat> wanted = pixelFormat(asked);
  NodeFormat before;
  if (node_.readFormat(before) != 0) return VideoNode::callFault(errno, "reading the format");
  DeviceFault first;
  for (const PixelFormat& candidate : kPixelFormats) {
    // Formats with two cameras in one image are used only on request.
    const bool fits = asked.empty() ? candidate.layout != PixelLayout::kPairs : candidate == wanted;
    if (!fits || !offersFormat(node_, code(candidate.fourcc()))) continue;
    DeviceFault fault = setFormat(candidate, before);
    if (fault.ok()) fault = setRate();
    if (fault.ok()) return fault;
    if (first.ok()) first = fault;
  }
  if (!first.ok()) return first;
  std::array<char, kOfferBytes> offers = {};
  writeFormats(node_, offers.data(), offers.size());
  if (asked.empty()) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "no supported format; offers %s", offers.data());
  }
  return deviceFault(DeviceFaultKind::kUnsupported, 0, "format %s is not %s; offers %s", asked.data(),
                     wanted ? "offered" : "supported", offers.data());
}

DeviceFault CameraDevice::setFormat(const PixelFormat& wanted, const NodeFormat& before) {
  // Keep the camera's current values for settings that are not given.
  const int width = settings_.width > 0 ? settings_.width : before.width;
  const int height = settings_.height > 0 ? settings_.height : before.height;
  NodeFormat format = {code(wanted.fourcc()), width, height};
  if (node_.setFormat(format) != 0) return VideoNode::callFault(errno, "setting the format (VIDIOC_S_FMT)");
  if (format.fourcc != code(wanted.fourcc()) || format.width != width || format.height != height) {
    std::array<char, kOfferBytes> offers = {};
    writeSizes(node_, code(wanted.fourcc()), offers.data(), offers.size());
    return deviceFault(DeviceFaultKind::kChanged, 0, "requested %dx%d, set %dx%d; %s offers %s", width,
                       height, format.width, format.height, wanted.letters.data(), offers.data());
  }
  if (!format.whole) return deviceFault(DeviceFaultKind::kUnsupported, 0, "sends interlaced images");
  facts_.format = wanted;
  facts_.width = width;
  facts_.height = height;
  facts_.stride = std::max(format.stride, wanted.rowBytes(width));
  return {};
}

DeviceFault CameraDevice::setRate() {
  v4l2_streamparm parameters = {};
  parameters.type = node_.type();
  v4l2_captureparm& capture = parameters.parm.capture;
  const bool can =
      node_.call(VIDIOC_G_PARM, &parameters) == 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0;
  if (!can) return {};
  const double lowest = (1 - kRateTolerance) * settings_.rate;
  double rate = settings_.rate;
  if (settings_.triggered && rate > 0) {
    // Asked for a rate between two modes, a driver may choose the one that is slower than the trigger.
    rate = slowestOffered(node_, code(facts_.format.fourcc()), facts_.width, facts_.height, lowest)
               .value_or(rate);
  }
  if (rate > 0) {
    capture.timeperframe = {kRateNumerator, static_cast<std::uint32_t>(std::lround(rate * kRateNumerator))};
    if (node_.call(VIDIOC_S_PARM, &parameters) != 0)
      return VideoNode::callFault(errno, "setting the frame rate");
  }
  if (capture.timeperframe.numerator == 0) return {};
  facts_.rate = static_cast<double>(capture.timeperframe.denominator) / capture.timeperframe.numerator;
  const bool fast = !settings_.triggered && facts_.rate > (1 + kRateTolerance) * settings_.rate;
  if (settings_.rate > 0 && (facts_.rate < lowest || fast)) {
    std::array<char, kOfferBytes> rates = {};
    writeRates(node_, code(facts_.format.fourcc()), facts_.width, facts_.height, rates.data(), rates.size());
    return deviceFault(DeviceFaultKind::kChanged, 0, "requested %.4g frames per second, set %.4g; offers %s",
                       settings_.rate, facts_.rate, rates.data());
  }
  return {};
}

DeviceFault CameraDevice::setBuffers() {
  DeviceFault fault = node_.mapBuffers(std::max(settings_.buffers, kMinBuffers));
  if (!fault.ok()) return fault;
  facts_.buffers = node_.bufferCount();
  if (facts_.buffers < kFewestBuffers) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "gave %zu buffers, at least %zu are required",
                       facts_.buffers, kFewestBuffers);
  }
  if (facts_.buffers < kMinBuffers) {
    warn(deviceFault(DeviceFaultKind::kChanged, 0, "requested %u buffers, got %zu: frames may be missed",
                     settings_.buffers, facts_.buffers));
  }
  facts_.event = stampEvent(node_.stampFlags(), first_data_);
  if (facts_.event == StampEvent::kArrival) {
    fault = deviceFault(DeviceFaultKind::kUnsupported, 0,
                        "stamps its images with a clock other than CLOCK_MONOTONIC");
    if (settings_.require_monotonic) return fault;
    warn(fault);
  }
  for (std::uint32_t i = 0; i < facts_.buffers; ++i) {
    if (!node_.queue(i)) return VideoNode::callFault(errno, "queuing a buffer (VIDIOC_QBUF)");
  }
  return {};
}

void CameraDevice::giveBack(std::uint32_t buffer) {
  if (isOpen() && !node_.queue(buffer)) ++counters_.requeue_failed;
}

void CameraDevice::countSequence(std::uint32_t sequence) {
  std::uint32_t step = 1;
  if (sequence_known_) {
    step = sequence - raw_sequence_;
    if (step == 0 || step >= kRestart) step = 1;
    counters_.missed += step - 1;
  }
  sequence_known_ = true;
  raw_sequence_ = sequence;
  sequence_ += step;
}

DeviceFault CameraDevice::closedBy(const DeviceFault& fault) {
  shut();
  return fault;
}

DeviceFault CameraDevice::next(CapturedFrame& frame) {
  frame.release();
  if (!isOpen())
    return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for the device to return");
  // Bounded, so that refused buffers cannot keep one call busy forever.
  for (std::size_t attempt = 0; attempt < VideoNode::kMaxBuffers; ++attempt) {
    FilledBuffer filled;
    if (!node_.dequeue(filled)) {
      if (errno != EAGAIN) return closedBy(VideoNode::callFault(errno, "taking an image (VIDIOC_DQBUF)"));
      // A stopped queue would report EAGAIN forever.
      if (!node_.inError()) return {};
      return closedBy(deviceFault(DeviceFaultKind::kUnplugged, 0, "the stream ended"));
    }
    const Stamp arrival = monotonicNow();
    countSequence(filled.sequence);
    // For a compressed image the decoder checks the data.
    const std::size_t needed =
        facts_.format.layout == PixelLayout::kJpeg
            ? 1
            : static_cast<std::size_t>(facts_.stride) * static_cast<std::size_t>(facts_.height - 1) +
                  static_cast<std::size_t>(facts_.format.rowBytes(facts_.width));
    const bool damaged = (filled.flags & V4L2_BUF_FLAG_ERROR) != 0;
    if (damaged || filled.bytes.size() < needed) {
      ++(damaged ? counters_.damaged : counters_.too_short);
      if (!node_.queue(filled.index)) ++counters_.requeue_failed;
      continue;
    }
    frame.image = {filled.bytes.data(), facts_.width, facts_.height, facts_.stride, facts_.format, 0,
                   filled.bytes.size()};
    frame.event = stampEvent(filled.flags, first_data_);
    frame.arrival = arrival;
    frame.stamp = frame.event == StampEvent::kArrival ? arrival : filled.stamp;
    if (frame.stamp > arrival) ++counters_.stamp_ahead;
    frame.sequence = sequence_;
    lend(frame, filled.index);
    return {};
  }
  return {};
}

}  // namespace swiftlet
