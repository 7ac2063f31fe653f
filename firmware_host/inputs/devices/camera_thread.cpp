#include "firmware_host/inputs/devices/camera_thread.hpp"

#include <poll.h>

#include "estimator/core/units.hpp"
#include "firmware_host/inputs/devices/device_times.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Frames of one round: more wait only after the thread was held up.
constexpr int kMostFrames = 8;
/// Images running that show nothing, or nothing new, before it is said: a hand before the lens, a lost frame
/// that the driver fills in.
constexpr int kOddImages = 5;

FrameEvent frameEvent(StampEvent event) {
  return event == StampEvent::kEndOfFrame ? FrameEvent::kEndOfFrame : FrameEvent::kStartOfExposure;
}

}  // namespace

CameraThread::CameraThread(const Setup& setup)
    : setup_(setup),
      journal_(setup.name),
      longest_silence_(longestSilence(setup.settings.rate_hz)),
      train_(Duration::fromSeconds(1 / setup.settings.rate_hz)),
      rate_(setup.settings.rate_hz) {
  timing_.readout = Duration::fromSeconds(setup_.settings.readout_ms * kFromMs);
  timing_.rolling = setup_.settings.shutter == kRolling;
  if (setup_.trigger) timing_.trigger_latency = Duration::fromSeconds(setup_.trigger->delay_us * kFromUs);
}

DeviceFault CameraThread::open() {
  const DeviceFault fault = device_.open(setup_.device);
  if (!fault.ok()) return fault;
  // As the camera has taken it.
  if (setup_.settings.exposure_ms > 0) timing_.exposure = device_.facts().exposure.value_or(Duration{});
  if (setup_.trigger) matcher_.emplace(train_, expectedLag(frameEvent(device_.facts().event), timing_));
  return fault;
}

void CameraThread::run(SensorSink& sink, const RunControl& control) {
  discard();
  newest_ = hostNow();
  while (!control.stopped()) {
    heart_.beat();
    takeEdges();
    if (!device_.isOpen()) {
      if (const DeviceFault fault = device_.reopen(); !fault.ok()) {
        journal_.fault(hostNow(), fault);
        sleepFor(kReopenPeriod);
        continue;
      }
      newest_ = hostNow();
    }
    pollfd waiting{device_.fd(), POLLIN, 0};
    poll(&waiting, 1, kPollMilliseconds);
    takeFrames(sink);
    publish();
    const Stamp now = hostNow();
    if (device_.isOpen() && now - newest_ > longest_silence_) {
      journal_.fault(
          now, deviceFault(DeviceFaultKind::kSilent, 0, "no frame for %.1f s", (now - newest_).seconds()));
    }
  }
}

void CameraThread::discard() {
  for (int i = 0; i < kMostFrames; ++i) {
    CapturedFrame frame;
    if (!device_.next(frame).ok() || !frame.valid()) break;
  }
  before_ = device_.counters();
}

void CameraThread::publish() {
  counted_.counters = device_.counters();
  counted_.counters.frames -= before_.frames;
  counted_.counters.missed -= before_.missed;
  status_.write(counted_);
}

void CameraThread::takeEdges() {
  EdgeMessage edge;
  // As many as fit into the ring: the trigger's thread goes on meanwhile.
  for (std::size_t i = 0; i < EdgeRing::capacity() && edges_.tryPop(edge); ++i) {
    if (matcher_) train_.add(edge.stamp, static_cast<std::uint32_t>(edge.sequence));
  }
}

void CameraThread::takeFrames(SensorSink& sink) {
  for (int i = 0; i < kMostFrames; ++i) {
    CapturedFrame frame;
    if (const DeviceFault fault = device_.next(frame); !fault.ok()) {
      journal_.fault(hostNow(), fault);
      return;
    }
    if (!frame.valid()) return;
    newest_ = frame.arrival;
    // The first tells how many went by while nobody fetched any.
    if (!any_) before_.missed = device_.counters().missed;
    any_ = true;
    if (watchQuality(frame)) hand(frame, sink);
  }
}

bool CameraThread::watchQuality(const CapturedFrame& frame) {
  const Stamp now = frame.arrival;
  const bool returned = journal_.standing() != DeviceFaultKind::kNone;
  journal_.works(now);
  const ImageWatch::Look look = images_.look(frame.image);
  odd_images_ = look == ImageWatch::Look::kNew ? 0 : odd_images_ + 1;
  bool counted = false;
  if (returned) {
    rate_.restart(now);
  } else {
    counted = rate_.add(now, 1);
  }
  if (odd_images_ >= kOddImages) {
    const bool dark = look == ImageWatch::Look::kDark;
    journal_.defect(now, deviceFault(dark ? DeviceFaultKind::kDark : DeviceFaultKind::kFrozen, 0,
                                     "%d images running", odd_images_));
  } else if (counted && rate_.tooFew()) {
    journal_.defect(now, deviceFault(DeviceFaultKind::kLossy, 0, "%.0f of %.0f frames in a second",
                                     rate_.seen(), rate_.expected()));
  } else if (counted && odd_images_ == 0) {
    journal_.sound(now);
  }
  if (look == ImageWatch::Look::kRepeated) ++counted_.repeated;
  return look != ImageWatch::Look::kRepeated;
}

Stamp CameraThread::middleOfExposure(const CapturedFrame& frame) {
  if (matcher_) {
    takeEdges();
    TriggerMatch match;
    const FrameMark mark{frame.stamp, static_cast<std::uint32_t>(frame.sequence), frame.arrival};
    const bool matched = matcher_->match(mark, match).ok();
    counted_.trigger = matcher_->status();
    if (matched) {
      ++counted_.by_trigger;
      return exposureMidpoint(match.edge, FrameEvent::kTriggerEdge, timing_);
    }
  }
  return exposureMidpoint(frame.stamp, frameEvent(frame.event), timing_);
}

void CameraThread::hand(const CapturedFrame& frame, SensorSink& sink) {
  CameraFrame image;
  image.stamp = middleOfExposure(frame);
  image.arrival = frame.arrival;
  image.clock = Clock::kMonotonic;
  image.sequence = frame.sequence;
  const HostTimes host{secondsOf(image.stamp), secondsOf(frame.arrival)};
  const auto toPlace = [](const void* from, std::uint8_t* to) {
    const auto& raw = *static_cast<const RawImage*>(from);
    toGrey(raw, to, raw.width);
  };
  const std::array<RawImage, 2> halves = sideBySide(frame.image);
  const std::uint32_t count = setup_.side_by_side ? 2 : 1;
  for (std::uint32_t i = 0; i < count; ++i) {
    const RawImage& raw = setup_.side_by_side ? halves[i] : frame.image;
    image.camera = setup_.first + i;
    image.image = {nullptr, raw.width, raw.height, raw.width};
    sink.takeImage(image, host, {toPlace, &raw});
  }
}

}  // namespace swiftlet
