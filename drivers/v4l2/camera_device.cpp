#include "drivers/v4l2/camera_device.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/v4l2/camera_controls.hpp"
#include "drivers/v4l2/camera_offers.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr std::uint32_t kMinBuffers = 4;   // one being filled, one waiting, two in the pipeline's hands
constexpr std::size_t kFewestBuffers = 2;  // with one, every second frame would be missed
// A device that wraps or restarts its count goes back by nearly 2^32: no hole of this size.
constexpr std::uint32_t kRestart = 1U << 31U;
constexpr double kRateTolerance = 0.005;        // of the rate; drivers round intervals to us
constexpr std::uint32_t kRateNumerator = 1000;  // mHz resolution of rates
constexpr std::size_t kOfferBytes = 140;        // leaves room for the words around it in a fault

std::uint32_t code(std::string_view letters) {
  return v4l2_fourcc(static_cast<std::uint32_t>(letters[0]), static_cast<std::uint32_t>(letters[1]),
                     static_cast<std::uint32_t>(letters[2]), static_cast<std::uint32_t>(letters[3]));
}

StampEvent eventOf(std::uint32_t flags) {
  if ((flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
    return StampEvent::kArrival;
  return (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
             ? StampEvent::kStartOfExposure
             : StampEvent::kEndOfFrame;
}

template <std::size_t kSize>
void copyText(const char* text, std::array<char, kSize>& out) {
  std::snprintf(out.data(), out.size(), "%s", text);
}

}  // namespace

void CameraDeviceSettings::setPath(const char* text) { copyText(text, path); }
void CameraDeviceSettings::setFormat(const char* text) { copyText(text, format); }

CapturedFrame& CapturedFrame::operator=(CapturedFrame&& other) noexcept {
  if (this == &other) return *this;
  release();
  image = other.image;
  stamp = other.stamp;
  event = other.event;
  arrival = other.arrival;
  sequence = other.sequence;
  buffer_ = other.buffer_;
  generation_ = other.generation_;
  device_ = std::exchange(other.device_, nullptr);
  return *this;
}

void CapturedFrame::release() {
  if (device_ != nullptr) device_->giveBack(*this);
  device_ = nullptr;
  image = {};
}

DeviceFault CameraDevice::open(const CameraDeviceSettings& settings) {
  close();
  settings_ = settings;
  warning_count_ = 0;
  facts_ = {};
  DeviceFault fault = node_.open(settings_.path.data(), kCapture);
  if (fault.ok()) fault = negotiate();
  return fault.ok() ? fault : closedBy(fault);
}

DeviceFault CameraDevice::reopen() {
  const CameraDeviceSettings same = settings_;
  DeviceFault fault = open(same);
  if (fault.ok()) ++counters_.reopened;
  return fault;
}

void CameraDevice::close() {
  node_.close();
  ++generation_;
  sequence_known_ = false;
}

DeviceFault CameraDevice::negotiate() {
  describeDevice();
  DeviceFault fault = chooseFormat();
  if (fault.ok()) fault = setFormat();
  if (fault.ok()) fault = setRate();
  if (!fault.ok()) return fault;
  if (settings_.exposure) warn(setExposure(node_, *settings_.exposure));
  if (settings_.gain) warn(setGain(node_, *settings_.gain));
  facts_.exposure = readExposure(node_);
  facts_.gain = readGain(node_);
  fault = setBuffers();
  if (fault.ok()) fault = node_.start();
  return fault;
}

void CameraDevice::describeDevice() {
  v4l2_capability capability = {};
  if (node_.call(VIDIOC_QUERYCAP, &capability) != 0) return;
  copyText(reinterpret_cast<const char*>(capability.driver), facts_.driver);
  copyText(reinterpret_cast<const char*>(capability.card), facts_.card);
  copyText(reinterpret_cast<const char*>(capability.bus_info), facts_.bus);
}

DeviceFault CameraDevice::chooseFormat() {
  std::array<char, kOfferBytes> offers = {};
  const std::string_view asked = settings_.format.data();
  const std::optional<PixelFormat> wanted = pixelFormat(asked);
  if (!asked.empty() && !wanted) {
    writeOffers(node_, offers.data(), offers.size());
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "format %s is not taken; offers %s", asked.data(),
                       offers.data());
  }
  for (const PixelFormat candidate : kPixelFormats) {
    if (wanted && candidate != *wanted) continue;
    v4l2_fmtdesc offered = {};
    offered.type = kCapture;
    for (; node_.call(VIDIOC_ENUM_FMT, &offered) == 0 && offered.index < UINT8_MAX; ++offered.index) {
      if (offered.pixelformat != code(fourcc(candidate))) continue;
      facts_.format = candidate;
      return {};
    }
  }
  writeOffers(node_, offers.data(), offers.size());
  return deviceFault(DeviceFaultKind::kUnsupported, 0, "%s; offers %s",
                     wanted ? settings_.format.data() : "none of GREY Y10 Y16 YUYV UYVY", offers.data());
}

DeviceFault CameraDevice::setFormat() {
  v4l2_format format = {};
  format.type = kCapture;
  // What is left open stays as the camera has it.
  if (node_.call(VIDIOC_G_FMT, &format) != 0) return VideoNode::callFault(errno, "read the format");
  v4l2_pix_format& pix = format.fmt.pix;
  const std::uint32_t asked = code(fourcc(facts_.format));
  const int width = settings_.width > 0 ? settings_.width : static_cast<int>(pix.width);
  const int height = settings_.height > 0 ? settings_.height : static_cast<int>(pix.height);
  pix.pixelformat = asked;
  pix.width = static_cast<std::uint32_t>(width);
  pix.height = static_cast<std::uint32_t>(height);
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = 0;
  pix.sizeimage = 0;
  if (node_.call(VIDIOC_S_FMT, &format) != 0)
    return VideoNode::callFault(errno, "set the format (VIDIOC_S_FMT)");
  facts_.width = static_cast<int>(pix.width);
  facts_.height = static_cast<int>(pix.height);
  facts_.stride = static_cast<int>(pix.bytesperline);
  if (pix.pixelformat != asked || facts_.width != width || facts_.height != height) {
    std::array<char, kOfferBytes> offers = {};
    writeOffers(node_, offers.data(), offers.size());
    return deviceFault(DeviceFaultKind::kChanged, 0, "asked %dx%d, set %dx%d; offers %s", width, height,
                       facts_.width, facts_.height, offers.data());
  }
  // Some drivers leave it open, and mean whole frames.
  if (pix.field != V4L2_FIELD_NONE && pix.field != V4L2_FIELD_ANY) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "sends interlaced images");
  }
  facts_.stride = std::max(facts_.stride, width * bytesPerPixel(facts_.format));
  return {};
}

DeviceFault CameraDevice::setRate() {
  v4l2_streamparm parameters = {};
  parameters.type = kCapture;
  v4l2_captureparm& capture = parameters.parm.capture;
  const bool can =
      node_.call(VIDIOC_G_PARM, &parameters) == 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0;
  if (!can) return {};
  if (settings_.rate > 0) {
    capture.timeperframe = {kRateNumerator,
                            static_cast<std::uint32_t>(std::lround(settings_.rate * kRateNumerator))};
    if (node_.call(VIDIOC_S_PARM, &parameters) != 0) return VideoNode::callFault(errno, "set the frame rate");
  }
  if (capture.timeperframe.numerator == 0) return {};
  facts_.rate = static_cast<double>(capture.timeperframe.denominator) / capture.timeperframe.numerator;
  if (settings_.rate > 0 && std::abs(facts_.rate - settings_.rate) > kRateTolerance * settings_.rate) {
    std::array<char, kOfferBytes> rates = {};
    writeRates(node_, code(fourcc(facts_.format)), facts_.width, facts_.height, rates.data(), rates.size());
    return deviceFault(DeviceFaultKind::kChanged, 0, "asked %.4g frames a second, set %.4g; offers %s",
                       settings_.rate, facts_.rate, rates.data());
  }
  return {};
}

DeviceFault CameraDevice::setBuffers() {
  DeviceFault fault = node_.mapBuffers(std::max(settings_.buffers, kMinBuffers));
  if (!fault.ok()) return fault;
  facts_.buffers = node_.bufferCount();
  if (facts_.buffers < kFewestBuffers) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "gave %zu buffers, at least %zu are needed",
                       facts_.buffers, kFewestBuffers);
  }
  if (facts_.buffers < kMinBuffers) {
    warn(deviceFault(DeviceFaultKind::kChanged, 0, "asked %u buffers, given %zu: frames may be missed",
                     settings_.buffers, facts_.buffers));
  }
  facts_.event = eventOf(node_.stampFlags());
  if (facts_.event == StampEvent::kArrival) {
    fault = deviceFault(DeviceFaultKind::kUnsupported, 0,
                        "stamps its images with another clock than CLOCK_MONOTONIC");
    if (settings_.require_monotonic) return fault;
    warn(fault);
  }
  for (std::uint32_t i = 0; i < facts_.buffers; ++i) {
    if (!queue(i)) return VideoNode::callFault(errno, "handed a buffer over (VIDIOC_QBUF)");
  }
  return {};
}

void CameraDevice::warn(const DeviceFault& fault) {
  if (!fault.ok() && warning_count_ < warnings_.size()) warnings_[warning_count_++] = fault;
}

bool CameraDevice::queue(std::uint32_t index) {
  v4l2_buffer buffer = {};
  buffer.index = index;
  buffer.type = kCapture;
  buffer.memory = V4L2_MEMORY_MMAP;
  return node_.call(VIDIOC_QBUF, &buffer) == 0;
}

void CameraDevice::giveBack(const CapturedFrame& frame) {
  if (frame.generation_ == generation_ && isOpen() && !queue(frame.buffer_)) ++counters_.requeue_failed;
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
  close();
  return fault;
}

DeviceFault CameraDevice::next(CapturedFrame& frame) {
  frame.release();
  if (!isOpen()) return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for it to come back");
  // Each refused buffer goes back to the driver, so that one call cannot be kept busy for ever.
  for (std::size_t attempt = 0; attempt < VideoNode::kMaxBuffers; ++attempt) {
    v4l2_buffer buffer = {};
    buffer.type = kCapture;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (node_.call(VIDIOC_DQBUF, &buffer) != 0) {
      if (errno != EAGAIN) return closedBy(VideoNode::callFault(errno, "took an image (VIDIOC_DQBUF)"));
      // A dead queue answers "nothing yet" for ever.
      if (!node_.inError()) return {};
      return closedBy(deviceFault(DeviceFaultKind::kUnplugged, 0, "the stream ended"));
    }
    const Stamp arrival = monotonicNow();
    countSequence(buffer.sequence);
    const std::size_t needed =
        static_cast<std::size_t>(facts_.stride) * static_cast<std::size_t>(facts_.height - 1) +
        static_cast<std::size_t>(facts_.width * bytesPerPixel(facts_.format));
    const bool damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    const bool too_short = buffer.bytesused < needed || node_.buffer(buffer.index).size() < needed;
    if (damaged || too_short) {
      ++(damaged ? counters_.damaged : counters_.too_short);
      if (!queue(buffer.index)) ++counters_.requeue_failed;
      continue;
    }
    frame.image = {node_.buffer(buffer.index).data(), facts_.width, facts_.height, facts_.stride,
                   facts_.format};
    frame.event = eventOf(buffer.flags);
    frame.arrival = arrival;
    frame.stamp = {buffer.timestamp.tv_sec * 1'000'000'000 + buffer.timestamp.tv_usec * 1'000};
    if (frame.event == StampEvent::kArrival) frame.stamp = arrival;
    if (frame.stamp > arrival) ++counters_.stamp_ahead;
    frame.sequence = sequence_;
    frame.device_ = this;
    frame.buffer_ = buffer.index;
    frame.generation_ = generation_;
    ++counters_.frames;
    return {};
  }
  return {};
}

std::optional<Duration> CameraDevice::exposure() const { return readExposure(node_); }

}  // namespace swiftlet
