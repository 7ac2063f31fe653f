#include "drivers/gstreamer/pipeline_source.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "drivers/gstreamer/running_pipeline.hpp"
#include "drivers/gstreamer/video_caps.hpp"

namespace swiftlet {
namespace {

/// Wait of the first open(): the pipeline's own start limits, plus GStreamer's first scan of its plugins.
constexpr Duration kPatienceAtStart = Duration::fromMilliseconds(15'000);
/// Wait of later calls, in flight.
constexpr Duration kPatienceInFlight = Duration::fromMilliseconds(100);
constexpr double kRateTolerance = 0.005;  // relative; the same as for V4L2
/// A larger step of GST_BUFFER_OFFSET is not a gap: the source counts something else (bytes of a file) or
/// restarted.
constexpr std::uint64_t kLargestHole = 1000;

template <std::size_t kSize>
void copyText(std::string_view text, std::array<char, kSize>& out) {
  std::snprintf(out.data(), out.size(), "%.*s", static_cast<int>(text.size()), text.data());
}

}  // namespace

struct PipelineSource::Pipeline {
  explicit Pipeline(const PipelineSettings& settings)
      : running(std::make_unique<RunningPipeline>(
            RunningPipeline::Asked{settings.text, settings.width, settings.height, settings.rate})) {}
  ~Pipeline() {
    letGo();
    RunningPipeline::dispose(std::move(running));
  }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// A lent image: mapped.
  struct Lent {
    GstSample* sample = nullptr;
    GstVideoFrame frame = {};
  };

  /// Reads a sample's caps if they have changed.
  DeviceFault readCaps(GstSample* sample, const PipelineSettings& settings);
  /// Number of frames since the previous sample, including lost ones.
  std::uint64_t stepTo(const PipelineSample& sample);
  void letGo(Lent& one) {
    gst_video_frame_unmap(&one.frame);
    gst_sample_unref(std::exchange(one.sample, nullptr));
  }
  void letGo() {
    for (Lent& one : lent) {
      if (one.sample != nullptr) letGo(one);
    }
    if (first.sample != nullptr) gst_sample_unref(std::exchange(first.sample, nullptr));
    gst_clear_caps(&caps);
  }

  std::unique_ptr<RunningPipeline> running;
  GstCaps* caps = nullptr;
  GstVideoInfo info = {};
  PixelFormat format;
  PipelineSample first;  ///< taken by open() but not yet returned
  std::array<Lent, kMostLent> lent;
  bool counting = false;
  std::uint64_t offset = 0;  ///< of the newest sample
  std::uint64_t number = 0;  ///< number of the newest sample
  std::uint64_t sequence = 0;
};

DeviceFault PipelineSource::Pipeline::readCaps(GstSample* sample, const PipelineSettings& settings) {
  GstCaps* given = gst_sample_get_caps(sample);
  if (given == caps) return {};
  gst_caps_replace(&caps, given);
  if (given == nullptr || gst_video_info_from_caps(&info, given) == FALSE) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "its buffers do not specify their content");
  }
  const char* name = gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info));
  const std::optional<PixelFormat> taken = pixelFormatOf(GST_VIDEO_INFO_FORMAT(&info));
  if (!taken) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "%s is not supported: end the pipeline with `videoconvert`", name);
  }
  format = *taken;
  if (GST_VIDEO_INFO_WIDTH(&info) != settings.width || GST_VIDEO_INFO_HEIGHT(&info) != settings.height) {
    return deviceFault(DeviceFaultKind::kChanged, 0,
                       "the calibration is for %dx%d, the pipeline delivers %dx%d %s: calibrate at that size",
                       settings.width, settings.height, GST_VIDEO_INFO_WIDTH(&info),
                       GST_VIDEO_INFO_HEIGHT(&info), name);
  }
  if (GST_VIDEO_INFO_IS_INTERLACED(&info)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "sends interlaced images: add `deinterlace`");
  }
  const double rate = info.fps_n > 0 ? static_cast<double>(info.fps_n) / info.fps_d : 0;
  if (rate > 0 && settings.rate > 0 && std::abs(rate - settings.rate) > kRateTolerance * settings.rate) {
    return deviceFault(DeviceFaultKind::kChanged, 0,
                       "requested %.4g frames per second, the pipeline delivers %.4g", settings.rate, rate);
  }
  return {};
}

std::uint64_t PipelineSource::Pipeline::stepTo(const PipelineSample& sample) {
  const std::uint64_t now = GST_BUFFER_OFFSET(gst_sample_get_buffer(sample.sample));
  const std::uint64_t before = std::exchange(offset, now);
  const std::uint64_t passed = sample.number - std::exchange(number, sample.number);
  if (!std::exchange(counting, true)) return 1;
  const bool counts = now != GST_BUFFER_OFFSET_NONE && before != GST_BUFFER_OFFSET_NONE && now > before &&
                      now - before <= kLargestHole;
  return std::max(counts ? now - before : 0, passed);
}

PipelineSource::PipelineSource(PipelineSettings settings)
    : settings_(std::move(settings)), pipeline_(std::make_unique<Pipeline>(settings_)) {}

PipelineSource::~PipelineSource() { shut(); }

int PipelineSource::fd() const { return pipeline_->running->fd(); }

DeviceFault PipelineSource::open() {
  shut();
  warning_count_ = 0;
  facts_ = {};
  Pipeline& p = *pipeline_;
  DeviceFault fault = p.running->start(opened_ ? kPatienceInFlight : kPatienceAtStart);
  if (!fault.ok()) return fault;
  open_ = true;
  // start() waited for two samples; the first one may have no stamp.
  PipelineSample unseen;
  if (p.running->take(unseen)) gst_sample_unref(unseen.sample);
  if (!p.running->take(p.first)) return closedBy(deviceFault(DeviceFaultKind::kSilent, 0, "no image"));
  fault = p.readCaps(p.first.sample, settings_);
  if (!fault.ok()) return closedBy(fault);
  copyText("GStreamer", facts_.driver);
  copyText(p.running->source(), facts_.card);
  facts_.format = p.format;
  facts_.width = settings_.width;
  facts_.height = settings_.height;
  facts_.stride = GST_VIDEO_INFO_PLANE_STRIDE(&p.info, 0);
  facts_.rate = p.info.fps_n > 0 ? static_cast<double>(p.info.fps_n) / p.info.fps_d : 0;
  facts_.exposure = settings_.exposure;
  const bool captured = p.first.timed && !p.running->stampsArrivals();
  facts_.event = captured ? StampEvent::kStartOfExposure : StampEvent::kArrival;
  if (!captured) {
    warn(deviceFault(
        DeviceFaultKind::kUnsupported, 0,
        "its images have no capture times: their arrival times are used, which are late and jitter"));
  }
  if (opened_) ++counters_.reopened;
  opened_ = true;
  return {};
}

void PipelineSource::shut() {
  if (!open_) return;
  open_ = false;
  forgetLent();
  pipeline_->letGo();
  pipeline_->counting = false;
  pipeline_->running->stop();
}

DeviceFault PipelineSource::closedBy(const DeviceFault& fault) {
  shut();
  return fault;
}

DeviceFault PipelineSource::next(CapturedFrame& frame) {
  frame.release();
  if (!open_) return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for the device to return");
  Pipeline& p = *pipeline_;
  auto* const free = std::ranges::find(p.lent, nullptr, &Pipeline::Lent::sample);
  if (free == p.lent.end()) return {};
  // Bounded, so that refused samples cannot keep one call busy forever.
  for (std::size_t attempt = 0; attempt < RunningPipeline::kMostWaiting; ++attempt) {
    PipelineSample sample = std::exchange(p.first, {});
    if (sample.sample == nullptr && !p.running->take(sample)) {
      const DeviceFault fault = p.running->look();
      return fault.ok() ? fault : closedBy(fault);
    }
    const std::uint64_t step = p.stepTo(sample);
    counters_.missed += step - 1;
    p.sequence += step;
    DeviceFault fault = p.readCaps(sample.sample, settings_);
    if (fault.ok() && !(p.format == facts_.format)) {
      fault = deviceFault(DeviceFaultKind::kChanged, 0, "its format changed to %s",
                          gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&p.info)));
    }
    if (!fault.ok()) {
      gst_sample_unref(sample.sample);
      return closedBy(fault);
    }
    GstBuffer* buffer = gst_sample_get_buffer(sample.sample);
    const bool damaged = GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_CORRUPTED);
    // A buffer that is too small for its caps cannot be mapped.
    if (damaged || gst_video_frame_map(&free->frame, &p.info, buffer, GST_MAP_READ) == FALSE) {
      ++(damaged ? counters_.damaged : counters_.too_short);
      gst_sample_unref(sample.sample);
      continue;
    }
    free->sample = sample.sample;
    frame.image = {static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&free->frame, 0)),
                   facts_.width, facts_.height, GST_VIDEO_FRAME_PLANE_STRIDE(&free->frame, 0), p.format};
    frame.event = sample.timed ? facts_.event : StampEvent::kArrival;
    frame.arrival = sample.arrival;
    frame.stamp = sample.timed ? sample.stamp : sample.arrival;
    if (frame.stamp > frame.arrival) ++counters_.stamp_ahead;
    frame.sequence = p.sequence;
    lend(frame, static_cast<std::uint32_t>(free - p.lent.begin()));
    return {};
  }
  return {};
}

void PipelineSource::giveBack(std::uint32_t buffer) { pipeline_->letGo(pipeline_->lent.at(buffer)); }

}  // namespace swiftlet
