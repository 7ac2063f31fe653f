#pragma once
// A camera behind a GStreamer pipeline that the user writes, without a sink: "libcamerasrc ! video/x-raw,..."
// Its images are lent in the pipeline's memory. docs/gstreamer.md has recipes.
//
// Formats: GRAY8, GRAY16_LE, NV12, NV21, I420, YV12, NV16, Y42B, YUY2, YVYU, UYVY, VYUY, whose luma is used
// unchanged; the pipeline must convert all others (`videoconvert`). The size must be the requested one.
// Stamps: PTS as running time plus the pipeline's base time, in CLOCK_MONOTONIC, which the pipeline is forced
// to use. Pipelines do not say which event a PTS marks: the start of the exposure is assumed, with a rolling
// shutter that of the first row. If a source stamps arrivals (a network source, or one with `do-timestamp`)
// or buffers have no PTS, the event is kArrival and a warning says so.
// Losses: gaps in GST_BUFFER_OFFSET if the source counts its frames there; images that arrived while three
// were waiting.
// Errors: values. An error reported by GStreamer, or the end of the stream, closes the source; open() builds
// the pipeline again. The first open() waits for images, some seconds at most; later ones, in flight, wait a
// tenth of a second at most while the pipeline continues to start.
// Threads: GStreamer's run under SCHED_OTHER. next() and returning frames allocate and lock: not for a thread
// of the flight path. Memory: three images wait, kMostLent are lent; the pipeline's own memory is not bounded
// here.
// Built without GStreamer (SWIFTLET_WITH_GSTREAMER), open() fails and says so.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "drivers/image/camera_source.hpp"

namespace swiftlet {

struct PipelineSettings {
  std::string text;  ///< as for gst-launch-1.0, without a sink
  int width = 0;     ///< pixels; if two cameras share an image, of both halves
  int height = 0;
  double rate = 0;                   ///< frames per second; 0: as the pipeline gives it
  std::optional<Duration> exposure;  ///< as set in the pipeline; empty: unknown
};

class PipelineSource : public CameraSource {
 public:
  /// Maximum number of frames lent at a time; next() gives none beyond.
  static constexpr std::size_t kMostLent = 2;

  explicit PipelineSource(PipelineSettings settings);
  ~PipelineSource() override;

  DeviceFault open() override;
  void close() override { shut(); }
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] int fd() const override;
  DeviceFault next(CapturedFrame& frame) override;
  [[nodiscard]] bool allocates() const override { return true; }

 private:
  struct Pipeline;

  void giveBack(std::uint32_t buffer) override;
  void shut();
  DeviceFault closedBy(const DeviceFault& fault);

  PipelineSettings settings_;
  std::unique_ptr<Pipeline> pipeline_;
  bool open_ = false;
  bool opened_ = false;  // at least once
};

}  // namespace swiftlet
