#pragma once
// A camera behind a GStreamer pipeline that the user writes, without a sink: "libcamerasrc ! video/x-raw,..."
// Its images are lent out as they lie in the pipeline's memory. docs/gstreamer.md has recipes.
//
// Formats: GRAY8, GRAY16_LE, NV12, NV21, I420, YV12, NV16, Y42B, YUY2, YVYU, UYVY, VYUY, whose luma is taken
// as it is; the pipeline converts all others (`videoconvert`). The size must be the one asked for. Stamps:
// PTS as running time plus the pipeline's base time, CLOCK_MONOTONIC: the pipeline is held to that clock.
// What moment a PTS marks no pipeline says: it is taken for the start of the exposure, of the first row where
// the shutter rolls. Where a source stamps arrivals (a network's, or one with `do-timestamp`), or buffers
// have no PTS, the event is kArrival and a warning says so.
// Losses: holes in GST_BUFFER_OFFSET where the source counts its frames there; images that came while three
// were waiting.
// Errors: values. What GStreamer reports, and the end of the stream, closes the source; open() builds the
// pipeline anew. The first open() waits for images, some seconds at most; later ones, in flight, a
// tenth of a second at most, and the pipeline goes on starting meanwhile.
// Threads: GStreamer's run under SCHED_OTHER. It allocates and locks, in next() and in giving frames back
// too: not for a thread of the flight path. Memory: three images wait, kMostLent are lent out; what else the
// pipeline holds is its own matter.
// Built without GStreamer (SWIFTLET_WITH_GSTREAMER), open() says so.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "drivers/image/camera_source.hpp"

namespace swiftlet {

struct PipelineSettings {
  std::string text;  ///< as gst-launch-1.0 takes it, without a sink
  int width = 0;     ///< pixels, of both halves where two cameras share an image
  int height = 0;
  double rate = 0;                   ///< frames a second; 0: as it is
  std::optional<Duration> exposure;  ///< that the pipeline sets; empty: not known
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
  bool opened_ = false;  // ever
};

}  // namespace swiftlet
