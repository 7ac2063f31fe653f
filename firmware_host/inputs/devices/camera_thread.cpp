#include "firmware_host/inputs/devices/camera_thread.hpp"

#include <poll.h>

#include <algorithm>

#include "drivers/device/monotonic_now.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/inputs/devices/device_times.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Most frames per round; more wait only after the thread was held up.
constexpr int kMostFrames = 8;
/// Consecutive dark or repeated images before a report. Fewer are normal: a hand in front of the lens, a lost
/// frame that the driver replaces.
constexpr int kOddImages = 5;

/// Frames without an edge before a report, as a time and, for slow cameras, as a number. The first match
/// takes 32 frames, a later one up to 11: three to notice a slip and eight to match again.
constexpr Duration kFirstMatchPatience = Duration::fromMilliseconds(5000);
constexpr int kFirstMatchFrames = 40;
constexpr Duration kUnmatchedPatience = Duration::fromMilliseconds(1000);
constexpr int kUnmatchedFrames = 16;

FrameEvent frameEvent(StampEvent event) {
  switch (event) {
    case StampEvent::kStartOfExposure:
      return FrameEvent::kStartOfExposure;
    case StampEvent::kEndOfExposure:
      return FrameEvent::kEndOfExposure;
    case StampEvent::kEndOfFrame:
      break;
    case StampEvent::kArrival:
      // A frame arrives after its end, by an unknown delay.
      break;
  }
  return FrameEvent::kEndOfFrame;
}

/// A guessed lag may be wrong by a whole period, and then every edge would be assigned to the wrong frame.
bool lagKnown(StampEvent event, const ExposureTiming& timing) {
  return event == StampEvent::kStartOfExposure ||
         (event == StampEvent::kEndOfExposure && timing.exposure.ns > 0) ||
         (event == StampEvent::kEndOfFrame && timing.exposure.ns > 0 && timing.readout.ns > 0);
}

}  // namespace

CameraThread::CameraThread(const Setup& setup, std::unique_ptr<CameraSource> source)
    : setup_(setup),
      source_(std::move(source)),
      journal_(setup.name),
      longest_silence_(longestSilence(setup.settings.rate_hz)),
      restart_wait_(kFirstRestartWait),
      train_(Duration::fromSeconds(1 / setup.settings.rate_hz)),
      rate_(setup.settings.rate_hz) {
  timing_.readout = Duration::fromSeconds(setup_.settings.readout_ms * kFromMs);
  timing_.rolling = setup_.settings.shutter == kRolling;
  if (setup_.trigger) timing_.trigger_latency = Duration::fromSeconds(setup_.trigger->delay_us * kFromUs);
  if (setup_.exposure) exposure_.emplace(*setup_.exposure);
}

DeviceFault CameraThread::openSource() {
  DeviceFault fault = source_->open();
  if (!fault.ok() || !exposure_) return fault;
  fault = exposure_->begin(*source_);
  if (!fault.ok()) source_->close();
  return fault;
}

DeviceFault CameraThread::open() {
  const DeviceFault fault = openSource();
  if (!fault.ok()) return fault;
  const CameraFacts& facts = source_->facts();
  reader_.reserve(facts.format, facts.width, facts.height, setup_.settings.side_by_side);
  prepared_ = facts;
  adoptTiming();
  said_count_ = source_->warnings().size();
  std::ranges::copy(source_->warnings(), said_.begin());
  return fault;
}

void CameraThread::adoptTiming() {
  const CameraFacts& facts = source_->facts();
  prepared_.event = facts.event;
  // The exposure that the camera applied.
  if (setup_.settings.exposure_ms > 0) timing_.exposure = facts.exposure.value_or(Duration{});
  if (exposure_) timing_.exposure = exposure_->asked().exposure;
  if (!setup_.trigger) return;
  if (!lagKnown(facts.event, timing_)) {
    matcher_.reset();
    return;
  }
  const Duration lag = expectedLag(frameEvent(facts.event), timing_);
  if (matcher_ && lag == expected_lag_) return;
  expected_lag_ = lag;
  ever_matched_ = false;
  matcher_.emplace(train_, lag);
}

void CameraThread::noteWarnings() {
  const std::span<const DeviceFault> warnings = source_->warnings();
  for (const DeviceFault& warning : warnings) {
    const auto same = [&](const DeviceFault& before) { return before.text() == warning.text(); };
    if (std::ranges::none_of(std::span(said_).first(said_count_), same))
      journal_.note(monotonicNow(), warning);
  }
  said_count_ = warnings.size();
  std::ranges::copy(warnings, said_.begin());
}

std::string CameraThread::triggerWarning() const {
  if (!setup_.trigger || matcher_ || prepared_.width == 0) return {};
  if (prepared_.event == StampEvent::kArrival) {
    return "trigger edges are not used, because its stamps are arrival times; use a driver or pipeline that "
           "stamps the start of exposure";
  }
  if (prepared_.event == StampEvent::kEndOfExposure) {
    return "trigger edges are not used, because its driver stamps the end of exposure and the exposure is "
           "unknown; set cameras.exposure_ms";
  }
  return "trigger edges are not used, because its driver stamps the end of the frame and exposure or readout "
         "is unknown; set cameras.exposure_ms and cameras.readout_ms";
}

SensorInput::Level CameraThread::level() const {
  const bool library = source_->allocates() || source_->facts().format.layout == PixelLayout::kJpeg;
  return library ? SensorInput::Level::kLibrary : SensorInput::Level::kSensor;
}

DeviceFault CameraThread::reopen() {
  if (prepared_.width == 0) return open();
  DeviceFault fault = openSource();
  if (!fault.ok()) return fault;
  const CameraFacts& facts = source_->facts();
  if (facts.format == prepared_.format && facts.width == prepared_.width &&
      facts.height == prepared_.height) {
    adoptTiming();
    noteWarnings();
    return fault;
  }
  fault = deviceFault(DeviceFaultKind::kChanged, 0, "reopened with %dx%d %s instead of %dx%d %s", facts.width,
                      facts.height, facts.format.letters.data(), prepared_.width, prepared_.height,
                      prepared_.format.letters.data());
  source_->close();
  return fault;
}

void CameraThread::run(SensorSink& sink, const RunControl& control) {
  discard();
  newest_ = monotonicNow();
  while (!control.stopped()) {
    heart_.beat();
    takeEdges();
    if (!source_->isOpen()) {
      if (const DeviceFault fault = reopen(); !fault.ok()) {
        journal_.fault(monotonicNow(), fault);
        sleepFor(kReopenPeriod);
        continue;
      }
      newest_ = monotonicNow();
    }
    pollfd waiting{source_->fd(), POLLIN, 0};
    poll(&waiting, 1, kPollMilliseconds);
    takeFrames(sink);
    publish();
    const Stamp now = monotonicNow();
    for (DeviceFault remark; source_->nextRemark(remark);) journal_.note(now, remark);
    watchSilence(now);
  }
}

void CameraThread::watchSilence(Stamp now) {
  if (!source_->isOpen() || now - newest_ <= longest_silence_) return;
  journal_.fault(now,
                 deviceFault(DeviceFaultKind::kSilent, 0, "no frame for %.1f s", (now - newest_).seconds()));
  if (now < restart_at_ || !source_->restarts()) return;
  source_->close();
  restart_at_ = now + restart_wait_;
  restart_wait_ = std::min(restart_wait_ + restart_wait_, kLongestRestartWait);
}

void CameraThread::discard() {
  for (int i = 0; i < kMostFrames; ++i) {
    CapturedFrame frame;
    if (!source_->next(frame).ok() || !frame.valid()) break;
  }
  before_ = source_->counters();
}

void CameraThread::publish() {
  counted_.counters = source_->counters();
  counted_.counters.frames -= before_.frames;
  counted_.counters.missed -= before_.missed;
  counted_.counters.lost -= before_.lost;
  counted_.counters.overrun -= before_.overrun;
  counted_.counters.damaged += undecoded_;
  status_.write(counted_);
}

void CameraThread::takeEdges() {
  EdgeMessage edge;
  // At most one ring of edges: the trigger's thread keeps adding.
  for (std::size_t i = 0; i < EdgeRing::capacity() && edges_.tryPop(edge); ++i) {
    if (matcher_) train_.add(edge.stamp, static_cast<std::uint32_t>(edge.sequence));
  }
}

void CameraThread::takeFrames(SensorSink& sink) {
  for (int i = 0; i < kMostFrames; ++i) {
    CapturedFrame frame;
    if (const DeviceFault fault = source_->next(frame); !fault.ok()) {
      journal_.fault(monotonicNow(), fault);
      return;
    }
    if (!frame.valid()) return;
    // The first frame's counters tell how many frames passed while none was fetched.
    if (!any_) before_.missed = source_->counters().missed;
    any_ = true;
    take(frame, sink);
  }
}

bool CameraThread::watchQuality(const ImageView& image, Stamp now) {
  const bool returned = journal_.standing() != DeviceFaultKind::kNone;
  journal_.works(now);
  const ImageWatch::Look look = images_.look(image);
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
                                     "%d images in a row", odd_images_));
  } else if (counted && rate_.tooFew()) {
    journal_.defect(now, deviceFault(DeviceFaultKind::kLossy, 0, "%.0f of %.0f expected frames in a second",
                                     rate_.seen(), rate_.expected()));
  } else if (counted && odd_images_ == 0) {
    journal_.sound(now);
  }
  if (look == ImageWatch::Look::kRepeated) ++counted_.repeated;
  return look != ImageWatch::Look::kRepeated;
}

void CameraThread::watchTrigger(bool matched, Stamp now) {
  if (matched) {
    if (said_unmatched_) journal_.note(now, DeviceFault{DeviceFaultKind::kMatched, 0, {}});
    said_unmatched_ = false;
    ever_matched_ = true;
    unmatched_ = 0;
    return;
  }
  const Duration patience = ever_matched_ ? kUnmatchedPatience : kFirstMatchPatience;
  const int fewest = ever_matched_ ? kUnmatchedFrames : kFirstMatchFrames;
  const int most = std::max(fewest, static_cast<int>(patience.seconds() * setup_.settings.rate_hz));
  unmatched_ = std::min(unmatched_ + 1, most);
  if (unmatched_ < most || said_unmatched_) return;
  said_unmatched_ = true;
  journal_.note(now, deviceFault(DeviceFaultKind::kUnmatched, 0,
                                 matcher_->lag() ? "%d in a row: stamped by their usual delay to the edge"
                                                 : "%d in a row: stamped by the driver",
                                 most));
}

Stamp CameraThread::middleOfExposure(const CapturedFrame& frame) {
  counted_.off_trigger = false;
  if (matcher_ && frame.event == prepared_.event) {
    takeEdges();
    TriggerMatch match;
    const FrameMark mark{frame.stamp, static_cast<std::uint32_t>(frame.sequence), frame.arrival};
    const bool matched = matcher_->match(mark, match).ok();
    counted_.trigger = matcher_->status();
    counted_.off_trigger = matcher_->lock() != LockState::kLocked;
    watchTrigger(matched, frame.arrival);
    if (matched) {
      ++counted_.by_trigger;
      return exposureMidpoint(match.edge, FrameEvent::kTriggerEdge, timing_);
    }
    // The driver's stamp less its usual delay to the edge. Without subtracting it, stamps would jump by the
    // delay.
    if (const std::optional<Duration> lag = matcher_->lag()) {
      ++counted_.by_lag;
      return exposureMidpoint(frame.stamp - *lag, FrameEvent::kTriggerEdge, timing_);
    }
  }
  return exposureMidpoint(frame.stamp, frameEvent(frame.event), timing_);
}

void CameraThread::take(const CapturedFrame& frame, SensorSink& sink) {
  const std::span<const ImageView> images = reader_.read(frame.image);
  if (images.empty()) {
    ++undecoded_;
    return;
  }
  newest_ = monotonicNow();
  restart_at_ = {};
  restart_wait_ = kFirstRestartWait;
  if (exposure_) timing_.exposure = exposure_->inForce(frame.sequence).exposure;
  if (watchQuality(images[0], frame.arrival)) handOver(frame, images, sink);
  if (!exposure_) return;
  // Also for a repeated image: a fully saturated image repeats too.
  const DeviceFault fault = exposure_->step(frame.sequence, images[0], frame.arrival, *source_);
  if (!fault.ok()) journal_.defect(frame.arrival, fault);
  counted_.asked = exposure_->asked();
}

void CameraThread::handOver(const CapturedFrame& frame, std::span<const ImageView> images, SensorSink& sink) {
  CameraFrame out;
  out.stamp = middleOfExposure(frame);
  out.arrival = frame.arrival;
  out.clock = Clock::kMonotonic;
  out.sequence = frame.sequence;
  out.camera = setup_.first;
  HostTimes host{secondsOf(out.stamp), secondsOf(frame.arrival)};
  host.open = timing_.exposure.seconds();
  if (exposure_) host.gain = exposure_->inForce(frame.sequence).gain;
  for (const ImageView& image : images) {
    out.image = image;
    sink.takeImage(out, host);
    ++out.camera;
  }
}

}  // namespace swiftlet
