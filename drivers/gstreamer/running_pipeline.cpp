#include "drivers/gstreamer/running_pipeline.hpp"

#include <poll.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string_view>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/gstreamer/video_caps.hpp"

namespace swiftlet {
namespace {

/// From start to the first image: a decoder waits for a complete group of pictures, usually one or two
/// seconds.
constexpr Duration kStartLimit = Duration::fromMilliseconds(5000);
/// How long dispose() waits for a pipeline to stop: a network source signs off at its server.
constexpr Duration kStopLimit = Duration::fromMilliseconds(5000);
/// Two samples, because GStreamer stamps a live source's first buffer with 0 if the source has no time of its
/// own.
constexpr int kFirstSamples = 2;
constexpr const char* kSinkName = "swiftlet_images";
constexpr auto kEnds = static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_EOS);
constexpr int kOfferBytes = 110;  // leaves room for the other text of a fault

void ring(int fd) {
  const std::uint64_t one = 1;
  static_cast<void>(!write(fd, &one, sizeof(one)));
}
void hush(int fd) {
  std::uint64_t count = 0;
  static_cast<void>(!read(fd, &count, sizeof(count)));
}

/// Makes a fault of an error and frees the error.
DeviceFault faultOf(DeviceFaultKind kind, GError* error) {
  const DeviceFault fault =
      deviceFault(kind, 0, "pipeline: %s", error == nullptr ? "no reason given" : error->message);
  g_clear_error(&error);
  return fault;
}

DeviceFaultKind kindOf(const GError& error) {
  if (error.domain != GST_RESOURCE_ERROR) return DeviceFaultKind::kUnplugged;
  switch (error.code) {
    case GST_RESOURCE_ERROR_NOT_FOUND:
      return DeviceFaultKind::kMissing;
    case GST_RESOURCE_ERROR_BUSY:
      return DeviceFaultKind::kBusy;
    case GST_RESOURCE_ERROR_NOT_AUTHORIZED:
      return DeviceFaultKind::kNoRights;
    case GST_RESOURCE_ERROR_SETTINGS:
      return DeviceFaultKind::kUnsupported;
    default:
      return DeviceFaultKind::kUnplugged;
  }
}

/// GStreamer's debug text is "file(line): function (): path:\nwhat happened".
std::string_view lastLine(const char* debug) {
  const std::string_view text = debug == nullptr ? "" : debug;
  const std::size_t end = text.rfind('\n');
  return end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
}

void unref(PipelineSample& sample) { gst_sample_unref(std::exchange(sample.sample, nullptr)); }

}  // namespace

RunningPipeline::RunningPipeline(Asked asked)
    : asked_(std::move(asked)),
      ready_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      told_(eventfd(0, EFD_CLOEXEC)),
      changed_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

RunningPipeline::~RunningPipeline() {
  for (const int fd : {ready_, told_, changed_}) ::close(fd);
}

void RunningPipeline::dispose(std::unique_ptr<RunningPipeline> pipeline) {
  if (pipeline == nullptr || !pipeline->has_keeper_) return;
  RunningPipeline& self = *pipeline;
  if (self.awaitEndOf(Phase::kStarting, kStartLimit + kStopLimit)) {
    self.stop();
    if (self.awaitEndOf(Phase::kStopping, kStopLimit)) {
      self.tellKeeper(Phase::kEnded);
      pthread_join(self.keeper_, nullptr);
      return;
    }
  }
  // Leaked on purpose: the keeper may still return from GStreamer and use it.
  pthread_detach(self.keeper_);
  static_cast<void>(pipeline.release());
}

DeviceFault RunningPipeline::start(Duration patience) {
  if (!startKeeper()) return deviceFault(DeviceFaultKind::kFailed, errno, "creating a thread");
  if (!awaitEndOf(Phase::kStopping, patience)) {
    return deviceFault(DeviceFaultKind::kBusy, 0, "the previous pipeline does not stop");
  }
  if (phase_.load() == Phase::kIdle) tellKeeper(Phase::kStarting);
  if (!awaitEndOf(Phase::kStarting, patience)) {
    return last_.ok() ? deviceFault(DeviceFaultKind::kMissing, 0, "the pipeline is starting") : last_;
  }
  if (phase_.load() == Phase::kStreaming) return last_ = {};
  last_ = failed_;
  phase_.store(Phase::kIdle);
  return last_;
}

void RunningPipeline::stop() {
  if (phase_.load() == Phase::kStreaming) tellKeeper(Phase::kStopping);
}

bool RunningPipeline::take(PipelineSample& out) {
  if (waiting_.tryPop(out)) return true;
  hush(ready_);
  return waiting_.tryPop(out);
}

DeviceFault RunningPipeline::look() const {
  GstMessage* message = gst_bus_pop_filtered(bus_, kEnds);
  return message == nullptr ? DeviceFault{} : faultOf(message);
}

bool RunningPipeline::startKeeper() {
  if (has_keeper_) return true;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  constexpr sched_param kNone{};
  pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
  pthread_attr_setschedparam(&attributes, &kNone);
  const int error = pthread_create(&keeper_, &attributes, &RunningPipeline::keep, this);
  pthread_attr_destroy(&attributes);
  has_keeper_ = error == 0;
  errno = error;
  return has_keeper_;
}

void RunningPipeline::tellKeeper(Phase phase) {
  phase_.store(phase);
  ring(told_);
}

bool RunningPipeline::awaitEndOf(Phase phase, Duration limit) const {
  const Stamp end = monotonicNow() + limit;
  while (phase_.load() == phase) {
    const Duration left = end - monotonicNow();
    if (left <= Duration{}) return false;
    pollfd waiting{changed_, POLLIN, 0};
    constexpr std::int64_t kNsPerMs = 1'000'000;
    poll(&waiting, 1, static_cast<int>(left.ns / kNsPerMs) + 1);
    hush(changed_);
  }
  return true;
}

void* RunningPipeline::keep(void* pipeline) {
  auto& self = *static_cast<RunningPipeline*>(pipeline);
  pthread_setname_np(pthread_self(), "gstreamer");
  for (;;) {
    hush(self.told_);
    switch (self.phase_.load()) {
      case Phase::kStarting:
        self.failed_ = self.startNow();
        self.phase_.store(self.failed_.ok() ? Phase::kStreaming : Phase::kFailed);
        break;
      case Phase::kStopping:
        self.stopNow();
        self.phase_.store(Phase::kIdle);
        break;
      case Phase::kEnded:
        return nullptr;
      default:
        break;
    }
    ring(self.changed_);
  }
}

DeviceFault RunningPipeline::startNow() {
  GError* error = nullptr;
  if (gst_init_check(nullptr, nullptr, &error) == FALSE) {
    return swiftlet::faultOf(DeviceFaultKind::kFailed, error);
  }
  DeviceFault fault = build();
  if (fault.ok()) fault = play();
  if (fault.ok()) {
    lookAtSources();
  } else {
    stopNow();
  }
  return fault;
}

DeviceFault RunningPipeline::build() {
  GError* error = nullptr;
  const std::string whole = asked_.text + " ! appsink name=" + kSinkName;
  pipeline_ = gst_parse_launch_full(whole.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline_ == nullptr || error != nullptr) {
    return swiftlet::faultOf(DeviceFaultKind::kWrongDevice, error);
  }
  gst_object_ref_sink(pipeline_);
  sink_ = gst_bin_get_by_name(GST_BIN(pipeline_), kSinkName);
  GstCaps* caps = acceptedCaps(asked_.width, asked_.height, asked_.rate);
  // Samples are taken as they arrive: none is queued in the sink, and the last one is not kept.
  g_object_set(sink_, "caps", caps, "sync", FALSE, "max-buffers", 1U, "enable-last-sample", FALSE, nullptr);
  gst_caps_unref(caps);
  GstAppSinkCallbacks callbacks = {};
  callbacks.new_sample = &RunningPipeline::onSample;
  gst_app_sink_set_callbacks(GST_APP_SINK(sink_), &callbacks, this, nullptr);
  bus_ = gst_element_get_bus(pipeline_);
  gst_bus_set_sync_handler(bus_, &RunningPipeline::onMessage, this, nullptr);
  return {};
}

DeviceFault RunningPipeline::play() {
  // Use CLOCK_MONOTONIC instead of the source's clock, so that running time + base time is CLOCK_MONOTONIC.
  auto* clock = GST_CLOCK(gst_object_ref_sink(
      g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_MONOTONIC, nullptr)));
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), clock);
  gst_object_unref(clock);
  came_.store(0);
  gst_element_set_state(pipeline_, GST_STATE_PLAYING);
  const Stamp end = monotonicNow() + kStartLimit;
  while (came_.load() < kFirstSamples) {
    constexpr GstClockTime kLook = 10 * GST_MSECOND;
    if (GstMessage* message = gst_bus_timed_pop_filtered(bus_, kLook, kEnds)) return faultOf(message);
    if (monotonicNow() > end) {
      return deviceFault(DeviceFaultKind::kSilent, 0, "no image within %.0f s of the pipeline's start",
                         kStartLimit.seconds());
    }
  }
  return {};
}

void RunningPipeline::lookAtSources() {
  stamps_arrivals_ = false;
  source_.clear();
  GstIterator* elements = gst_bin_iterate_recurse(GST_BIN(pipeline_));
  const auto look = [](const GValue* value, void* pipeline) {
    auto& self = *static_cast<RunningPipeline*>(pipeline);
    GstElement* element = GST_ELEMENT(g_value_get_object(value));
    if (!GST_OBJECT_FLAG_IS_SET(element, GST_ELEMENT_FLAG_SOURCE)) return;
    const GstElementFactory* factory = gst_element_get_factory(element);
    if (factory != nullptr) self.source_ = GST_OBJECT_NAME(factory);
    const char* kind =
        gst_element_class_get_metadata(GST_ELEMENT_GET_CLASS(element), GST_ELEMENT_METADATA_KLASS);
    const bool network = kind != nullptr && std::string_view(kind).find("Network") != std::string_view::npos;
    self.stamps_arrivals_ = self.stamps_arrivals_ || network;
    if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), "do-timestamp") == nullptr) return;
    gboolean stamps = FALSE;
    g_object_get(element, "do-timestamp", &stamps, nullptr);
    self.stamps_arrivals_ = self.stamps_arrivals_ || stamps == TRUE;
  };
  while (gst_iterator_foreach(elements, look, this) == GST_ITERATOR_RESYNC) gst_iterator_resync(elements);
  gst_iterator_free(elements);
}

void RunningPipeline::stopNow() {
  if (pipeline_ == nullptr) return;
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  gst_clear_object(&bus_);
  gst_clear_object(&sink_);
  gst_clear_object(&pipeline_);
  PipelineSample left;
  while (waiting_.tryPop(left)) unref(left);
  hush(ready_);
}

GstBusSyncReply RunningPipeline::onMessage(GstBus* /*bus*/, GstMessage* message, void* self) {
  if ((GST_MESSAGE_TYPE(message) & kEnds) == 0) {
    gst_message_unref(message);
    return GST_BUS_DROP;
  }
  ring(static_cast<RunningPipeline*>(self)->ready_);
  return GST_BUS_PASS;
}

GstFlowReturn RunningPipeline::onSample(GstAppSink* sink, void* self) {
  GstSample* sample = gst_app_sink_pull_sample(sink);
  if (sample == nullptr) return GST_FLOW_EOS;
  static_cast<RunningPipeline*>(self)->hold(sample);
  return GST_FLOW_OK;
}

void RunningPipeline::hold(GstSample* sample) {
  PipelineSample held;
  held.sample = sample;
  held.arrival = monotonicNow();
  held.number = number_++;
  const GstClockTime running = gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME,
                                                           GST_BUFFER_PTS(gst_sample_get_buffer(sample)));
  held.timed = GST_CLOCK_TIME_IS_VALID(running);
  if (held.timed) {
    held.stamp.ns = static_cast<std::int64_t>(running + gst_element_get_base_time(GST_ELEMENT(sink_)));
  }
  if (!waiting_.tryPush(held)) unref(held);
  ring(ready_);
  came_.fetch_add(1);
}

DeviceFault RunningPipeline::faultOf(GstMessage* message) const {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS) {
    gst_message_unref(message);
    return deviceFault(DeviceFaultKind::kUnplugged, 0, "the pipeline's stream ended");
  }
  GError* error = nullptr;
  char* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  const std::string_view more = lastLine(debug);
  DeviceFault fault;
  if (more.find("not-negotiated") != std::string_view::npos) {
    GstPad* pad = gst_element_get_static_pad(sink_, "sink");
    GstCaps* given = gst_pad_peer_query_caps(pad, nullptr);
    char* text = given == nullptr ? nullptr : gst_caps_to_string(given);
    fault = deviceFault(DeviceFaultKind::kUnsupported, 0,
                        "end the pipeline with `videoconvert`; it delivers %.*s", kOfferBytes,
                        text == nullptr ? "nothing" : text);
    g_free(text);
    gst_clear_caps(&given);
    gst_object_unref(pad);
  } else {
    fault = deviceFault(kindOf(*error), 0, "%s: %s%s%.*s", GST_MESSAGE_SRC_NAME(message), error->message,
                        more.empty() ? "" : " ", static_cast<int>(more.size()), more.data());
  }
  g_clear_error(&error);
  g_free(debug);
  gst_message_unref(message);
  return fault;
}

}  // namespace swiftlet
