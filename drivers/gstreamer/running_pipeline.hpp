#pragma once
// A running pipeline of the user: built, started and stopped by its own thread, and its output.
//
// Threads: `keeper`, which builds, starts and stops pipelines, is created by the first start() under
// SCHED_OTHER regardless of the caller's scheduling; GStreamer's threads, which it creates, inherit that.
// GStreamer's streaming thread fills the ring. All other calls are from one thread, which waits for the
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

/// As it came into the sink.
struct PipelineSample {
  GstSample* sample = nullptr;  ///< to be unreferenced by who takes it
  Stamp stamp;                  ///< of its PTS, CLOCK_MONOTONIC
  Stamp arrival;                ///< CLOCK_MONOTONIC
  std::uint64_t number = 0;     ///< of those that came into the sink, let go or not
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

  /// Stops it and ends the keeper. One that does not return from GStreamer is left behind with all it uses.
  static void dispose(std::unique_ptr<RunningPipeline> pipeline);

  /// Starts the pipeline unless it is starting, and waits until two samples have arrived, at most `patience`.
  /// The first one may have no stamp. Ok: streaming. While it is starting: the last fault, or that it is
  /// starting.
  DeviceFault start(Duration patience);
  /// Tells the keeper to stop it; does not wait.
  void stop();

  /// Readable when a sample, an error or the end of the stream is there.
  [[nodiscard]] int fd() const { return ready_; }
  /// While streaming: the oldest sample; false: none.
  [[nodiscard]] bool take(PipelineSample& out);
  /// While streaming: the fault that ended the pipeline; ok: none.
  [[nodiscard]] DeviceFault look() const;
  /// While streaming: a source stamps buffers when they arrive: a network's, or one with `do-timestamp`.
  [[nodiscard]] bool stampsArrivals() const { return stamps_arrivals_; }
  /// While streaming: what makes its images, "videotestsrc".
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  enum class Phase : std::uint8_t { kIdle, kStarting, kStreaming, kFailed, kStopping, kEnded };

  // Of the keeper.
  static void* keep(void* self);
  [[nodiscard]] DeviceFault startNow();
  [[nodiscard]] DeviceFault build();
  [[nodiscard]] DeviceFault play();
  void lookAtSources();
  void stopNow();

  // Of GStreamer's threads.
  static GstFlowReturn onSample(GstAppSink* sink, void* self);
  static GstBusSyncReply onMessage(GstBus* bus, GstMessage* message, void* self);
  void hold(GstSample* sample);

  bool startKeeper();
  void tellKeeper(Phase phase);
  /// False: `phase` still lasts.
  bool awaitEndOf(Phase phase, Duration limit) const;
  [[nodiscard]] DeviceFault faultOf(GstMessage* message) const;

  const Asked asked_;
  int ready_ = -1;    ///< eventfd
  int told_ = -1;     ///< eventfd: the keeper has something to do
  int changed_ = -1;  ///< eventfd: the keeper is done with it
  pthread_t keeper_{};
  bool has_keeper_ = false;
  std::atomic<Phase> phase_{Phase::kIdle};
  DeviceFault failed_;  ///< the keeper's, in kFailed
  DeviceFault last_;    ///< of start()
  GstElement* pipeline_ = nullptr;
  GstElement* sink_ = nullptr;
  GstBus* bus_ = nullptr;
  bool stamps_arrivals_ = false;
  std::string source_;
  std::uint64_t number_ = 0;
  std::atomic<int> came_{0};  ///< samples of this start
  SpscRing<PipelineSample, kMostWaiting> waiting_;
};

}  // namespace swiftlet
