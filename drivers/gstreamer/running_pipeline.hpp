#pragma once
// A running pipeline of the user and its output. A thread of its own builds, starts and stops it.
//
// Threads: `keeper`, which builds, starts and stops pipelines, is created by the first start() under
// SCHED_OTHER regardless of the caller's scheduling; GStreamer's threads, which it creates, inherit that.
// GStreamer's streaming thread fills the ring. All other calls come from one thread, which waits for the
// others only for a bounded time. Memory: kMostWaiting samples wait, further ones are dropped at once; errors
// and the end of the stream are the only messages kept.

#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "drivers/device/device_fault.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// A sample as it arrived at the sink.
struct PipelineSample {
  GstSample* sample = nullptr;  ///< the taker must unreference it
  Stamp stamp;                  ///< PTS converted to CLOCK_MONOTONIC
  Stamp arrival;                ///< CLOCK_MONOTONIC
  std::uint64_t number = 0;     ///< counts all samples that arrived at the sink, including dropped ones
  bool timed = false;           ///< it has a PTS
};

class RunningPipeline {
 public:
  static constexpr std::size_t kMostWaiting = 3;

  struct Asked {
    std::string text;  ///< without a sink
    int width = 0;
    int height = 0;
    double rate = 0;
  };

  explicit RunningPipeline(Asked asked);
  ~RunningPipeline();
  RunningPipeline(const RunningPipeline&) = delete;
  RunningPipeline& operator=(const RunningPipeline&) = delete;

  /// Stops the pipeline and ends the keeper. If the keeper does not return from GStreamer, it is leaked with
  /// all it uses.
  static void dispose(std::unique_ptr<RunningPipeline> pipeline);

  /// Starts the pipeline unless it is starting, and waits at most `patience` until two samples have arrived,
  /// as the first one may have no stamp. Ok: streaming. Otherwise the last fault, or that it is still
  /// starting.
  DeviceFault start(Duration patience);
  /// Tells the keeper to stop the pipeline; does not wait.
  void stop();

  /// Readable when a sample, an error or the end of the stream is available.
  [[nodiscard]] int fd() const { return ready_; }
  /// While streaming: the oldest sample; false: none.
  [[nodiscard]] bool take(PipelineSample& out);
  /// While streaming: the fault that ended the pipeline; ok: none.
  [[nodiscard]] DeviceFault look() const;
  /// While streaming: whether a source stamps buffers at their arrival, as network sources and `do-timestamp`
  /// do.
  [[nodiscard]] bool stampsArrivals() const { return stamps_arrivals_; }
  /// While streaming: the element that produces the images, such as "videotestsrc".
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  enum class Phase : std::uint8_t { kIdle, kStarting, kStreaming, kFailed, kStopping, kEnded };

  // Run by the keeper.
  static void* keep(void* self);
  [[nodiscard]] DeviceFault startNow();
  [[nodiscard]] DeviceFault build();
  [[nodiscard]] DeviceFault play();
  void lookAtSources();
  void stopNow();

  // Run by GStreamer's threads.
  static GstFlowReturn onSample(GstAppSink* sink, void* self);
  static GstBusSyncReply onMessage(GstBus* bus, GstMessage* message, void* self);
  void hold(GstSample* sample);

  bool startKeeper();
  void tellKeeper(Phase phase);
  /// Waits until `phase` ends; false: it still lasts after `limit`.
  bool awaitEndOf(Phase phase, Duration limit) const;
  [[nodiscard]] DeviceFault faultOf(GstMessage* message) const;

  const Asked asked_;
  int ready_ = -1;    ///< eventfd
  int told_ = -1;     ///< eventfd: the keeper has work
  int changed_ = -1;  ///< eventfd: the keeper has finished it
  pthread_t keeper_{};
  bool has_keeper_ = false;
  std::atomic<Phase> phase_{Phase::kIdle};
  DeviceFault failed_;  ///< written by the keeper in kFailed
  DeviceFault last_;    ///< newest fault of start()
  GstElement* pipeline_ = nullptr;
  GstElement* sink_ = nullptr;
  GstBus* bus_ = nullptr;
  bool stamps_arrivals_ = false;
  std::string source_;
  std::uint64_t number_ = 0;
  std::atomic<int> came_{0};  ///< samples since this start
  SpscRing<PipelineSample, kMostWaiting> waiting_;
};

}  // namespace swiftlet
