#pragma once
// The thread of one camera source: passes grey images to the sink, stamped at mid-exposure on
// CLOCK_MONOTONIC. The camera may be unplugged and return.
//
// Stamps: the trigger's edge if one is connected, the delay from it to the driver's stamps is known and the
// association is certain; otherwise the driver's stamp, less its delay to the edge once that was measured
// (drivers/timesync/exposure_midpoint.hpp explains how each is moved to mid-exposure). Threads: open() before
// the flight, run() on its own thread, journal and status from any. Memory: no allocation after open(),
// except by a source that is reopened and by the decoder of compressed images.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "drivers/image/camera_source.hpp"
#include "drivers/image/grey_reader.hpp"
#include "drivers/timesync/exposure_midpoint.hpp"
#include "drivers/timesync/trigger_matcher.hpp"
#include "estimator/core/newest_shared.hpp"
#include "firmware_host/inputs/devices/edge_message.hpp"
#include "firmware_host/inputs/devices/exposure_loop.hpp"
#include "firmware_host/inputs/devices/image_watch.hpp"
#include "firmware_host/inputs/devices/rate_watch.hpp"
#include "firmware_host/interfaces/device_journal.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// What a camera did so far.
struct CameraStatus {
  CameraCounters counters;
  std::uint64_t repeated = 0;            ///< frames equal to the previous one; dropped
  std::uint64_t by_trigger = 0;          ///< frames stamped by a trigger edge
  std::uint64_t by_lag = 0;              ///< by the driver's stamp, less its measured delay to the edge
  TimesyncStatus trigger;                ///< where one is connected
  bool off_trigger = false;              ///< edges are to stamp the frames, but are not associated with them
  std::optional<ExposureSetting> asked;  ///< by exposure control
};

class CameraThread {
 public:
  struct Setup {
    std::string name;         ///< "camera 0 (/dev/video0)"
    std::uint32_t first = 0;  ///< the rig's camera that it is; where it gives two, the next is the other
    CamerasGroup settings;
    std::optional<TriggerGroup> trigger = {};
    std::optional<ExposureLoop::Setup> exposure = {};  ///< where it is controlled
  };

  CameraThread(const Setup& setup, std::unique_ptr<CameraSource> source);

  DeviceFault open();
  /// After open(): as it runs. Frames of a library's, and pictures that are decompressed, cost allocations
  /// and locks.
  [[nodiscard]] SensorInput::Level level() const;
  /// What the camera took otherwise than it was asked; after open().
  [[nodiscard]] std::span<const DeviceFault> warnings() const { return source_->warnings(); }
  /// After open(): why trigger edges are not used, and what to do; empty: they are used, or there are none.
  [[nodiscard]] std::string triggerWarning() const;
  void run(SensorSink& sink, const RunControl& control);
  /// Of run(), at each turn.
  [[nodiscard]] Heartbeat& heart() { return heart_; }

  /// Where the trigger's thread leaves its edges.
  [[nodiscard]] EdgeRing& edges() { return edges_; }
  [[nodiscard]] DeviceJournal& journal() { return journal_; }
  [[nodiscard]] const CameraFacts& facts() const { return source_->facts(); }
  [[nodiscard]] CameraStatus status() const {
    CameraStatus status;
    static_cast<void>(status_.read(status));
    return status;
  }
  /// Any thread: images handed over.
  [[nodiscard]] std::uint64_t taken() const { return status().counters.frames; }

 private:
  /// In flight. Ok: it gives the images that open() prepared for.
  DeviceFault reopen();
  /// The source with the control of its exposure, at first and when it is there again.
  DeviceFault openSource();
  /// Exposure and stamps of the source that has just been opened.
  void adoptTiming();
  /// Of a source that was reopened: what it did not say at the opening before.
  void noteWarnings();
  /// A stream that has stalled is closed, for run() to reopen.
  void watchSilence(Stamp now);
  /// Frames that wait from before the flight.
  void discard();
  void takeEdges();
  void takeFrames(SensorSink& sink);
  void publish();
  void take(const CapturedFrame& frame, SensorSink& sink);
  void handOver(const CapturedFrame& frame, std::span<const ImageView> images, SensorSink& sink);
  /// False: an image that is none.
  bool watchQuality(const ImageView& image, Stamp arrival);
  /// Notes when frames match no edges for long, and when they do again.
  void watchTrigger(bool matched, Stamp now);
  [[nodiscard]] Stamp middleOfExposure(const CapturedFrame& frame);

  Setup setup_;
  std::unique_ptr<CameraSource> source_;
  GreyReader reader_;
  CameraFacts prepared_;  ///< what reader_ has memory for; of no width before open()
  std::array<DeviceFault, CameraSource::kMostWarnings> said_;  ///< warnings of the newest opening
  std::size_t said_count_ = 0;
  Heartbeat heart_;
  DeviceJournal journal_;
  Duration longest_silence_;
  Duration restart_wait_;  ///< until the next restart of a silent stream; grows while none helps
  Stamp restart_at_;       ///< of a silent stream
  ExposureTiming timing_;  ///< of the image at hand
  std::optional<ExposureLoop> exposure_;
  EdgeRing edges_;
  EdgeTrain train_;
  Duration expected_lag_;                  ///< of matcher_
  std::optional<TriggerMatcher> matcher_;  ///< where a trigger is connected and the stamps' delay is known
  int unmatched_ = 0;                      ///< frames in a row without an edge
  bool ever_matched_ = false;              ///< by this opening's matcher
  bool said_unmatched_ = false;
  RateWatch rate_;
  ImageWatch images_;
  int odd_images_ = 0;  ///< dark or repeated, running
  Stamp newest_;        ///< when the newest image was taken, or since when there is none
  std::uint64_t undecoded_ = 0;
  CameraCounters before_;  ///< when the flight began
  bool any_ = false;       ///< a frame was handed over
  CameraStatus counted_;
  NewestShared<CameraStatus> status_;
};

}  // namespace swiftlet
