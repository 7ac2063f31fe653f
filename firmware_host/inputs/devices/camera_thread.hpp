#pragma once
// The thread of one camera source: passes grey images to the sink, stamped at mid-exposure on
// CLOCK_MONOTONIC. The camera may be unplugged and return.
//
// Stamps: the trigger's edge if a trigger is connected, the delay from the edge to the driver's stamps is
// known and the association is certain; otherwise the driver's stamp, less its delay to the edge once that
// has been measured (drivers/timesync/exposure_midpoint.hpp explains how each is moved to mid-exposure).
// Threads: open() before the flight, run() on its own thread, journal and status from any. Memory: no
// allocation after open(), except by a source that is reopened and by the decoder of compressed images.

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

/// Counters of a camera so far.
struct CameraStatus {
  CameraCounters counters;
  std::uint64_t repeated = 0;            ///< frames equal to the previous one; dropped
  std::uint64_t by_trigger = 0;          ///< frames stamped by a trigger edge
  std::uint64_t by_lag = 0;              ///< frames stamped by the driver's stamp less its measured delay
  TimesyncStatus trigger;                ///< only if a trigger is connected
  bool off_trigger = false;              ///< trigger edges are used, but the frames match none
  std::optional<ExposureSetting> asked;  ///< requested by exposure control
};

class CameraThread {
 public:
  struct Setup {
    std::string name;         ///< "camera 0 (/dev/video0)"
    std::uint32_t first = 0;  ///< the camera's index in the rig; of a source with two images, the first one's
    CamerasGroup settings;
    std::optional<TriggerGroup> trigger = {};
    std::optional<ExposureLoop::Setup> exposure = {};  ///< only if the exposure is controlled
  };

  CameraThread(const Setup& setup, std::unique_ptr<CameraSource> source);

  DeviceFault open();
  /// After open(): level of the thread. Sources behind a library and decompression allocate and lock.
  [[nodiscard]] SensorInput::Level level() const;
  /// After open(): settings that the camera applied differently.
  [[nodiscard]] std::span<const DeviceFault> warnings() const { return source_->warnings(); }
  /// After open(): why trigger edges are not used, and the remedy; empty: they are used, or there are none.
  [[nodiscard]] std::string triggerWarning() const;
  void run(SensorSink& sink, const RunControl& control);
  /// Beats at each turn of run().
  [[nodiscard]] Heartbeat& heart() { return heart_; }

  /// Ring into which the trigger's thread pushes edges.
  [[nodiscard]] EdgeRing& edges() { return edges_; }
  [[nodiscard]] DeviceJournal& journal() { return journal_; }
  [[nodiscard]] const CameraFacts& facts() const { return source_->facts(); }
  [[nodiscard]] CameraStatus status() const {
    CameraStatus status;
    static_cast<void>(status_.read(status));
    return status;
  }
  /// Any thread: number of images handed over.
  [[nodiscard]] std::uint64_t taken() const { return status().counters.frames; }

 private:
  /// In flight. Ok: the source delivers images of the format that open() prepared for.
  DeviceFault reopen();
  /// Opens the source and its exposure control, at first and when it has returned.
  DeviceFault openSource();
  /// Adopts exposure and stamp event of the source that was just opened.
  void adoptTiming();
  /// Notes warnings of a reopened source that differ from those of the previous opening.
  void noteWarnings();
  /// Closes a stalled stream; run() reopens it.
  void watchSilence(Stamp now);
  /// Discards frames queued before the flight.
  void discard();
  void takeEdges();
  void takeFrames(SensorSink& sink);
  void publish();
  void take(const CapturedFrame& frame, SensorSink& sink);
  void handOver(const CapturedFrame& frame, std::span<const ImageView> images, SensorSink& sink);
  /// False: the image repeats the previous one and is not used.
  bool watchQuality(const ImageView& image, Stamp arrival);
  /// Notes when frames have matched no edges for long, and when they match again.
  void watchTrigger(bool matched, Stamp now);
  [[nodiscard]] Stamp middleOfExposure(const CapturedFrame& frame);

  Setup setup_;
  std::unique_ptr<CameraSource> source_;
  GreyReader reader_;
  CameraFacts prepared_;  ///< format that reader_ has memory for; width 0 before open()
  std::array<DeviceFault, CameraSource::kMostWarnings> said_;  ///< warnings of the newest opening
  std::size_t said_count_ = 0;
  Heartbeat heart_;
  DeviceJournal journal_;
  Duration longest_silence_;
  Duration restart_wait_;  ///< until the next restart of a silent stream; grows while restarts do not help
  Stamp restart_at_;       ///< time of the next restart of a silent stream
  ExposureTiming timing_;  ///< of the current image
  std::optional<ExposureLoop> exposure_;
  EdgeRing edges_;
  EdgeTrain train_;
  Duration expected_lag_;                  ///< expected lag of matcher_
  std::optional<TriggerMatcher> matcher_;  ///< only if a trigger is connected and the stamps' delay is known
  int unmatched_ = 0;                      ///< consecutive frames without an edge
  bool ever_matched_ = false;              ///< by the matcher of this opening
  bool said_unmatched_ = false;
  RateWatch rate_;
  ImageWatch images_;
  int odd_images_ = 0;  ///< consecutive dark or repeated images
  Stamp newest_;        ///< when the newest image arrived; before the first, when waiting began
  std::uint64_t undecoded_ = 0;
  CameraCounters before_;  ///< at the start of the flight
  bool any_ = false;       ///< a frame was handed over
  CameraStatus counted_;
  NewestShared<CameraStatus> status_;
};

}  // namespace swiftlet
