#pragma once
// The thread of one video node: frames from the kernel's buffers to the sink, stamped in the middle of their
// exposure on CLOCK_MONOTONIC. Survives that the node goes and returns.
//
// Stamps: the trigger's edge where one is connected and the association is sure, else the driver's stamp
// (drivers/timesync/exposure_midpoint.hpp says how each is moved to the middle).
// Threads: open() before the flight, run() on its own thread, journal and status from any.
// Memory: nothing after open() but what a reopened node maps anew.

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/timesync/exposure_midpoint.hpp"
#include "drivers/timesync/trigger_matcher.hpp"
#include "drivers/v4l2/camera_device.hpp"
#include "estimator/core/newest_shared.hpp"
#include "firmware_host/inputs/devices/edge_message.hpp"
#include "firmware_host/inputs/devices/image_watch.hpp"
#include "firmware_host/inputs/devices/rate_watch.hpp"
#include "firmware_host/interfaces/device_journal.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// What a camera did so far.
struct CameraStatus {
  CameraCounters counters;
  std::uint64_t repeated = 0;    ///< frames that showed what the one before showed; left out
  std::uint64_t by_trigger = 0;  ///< frames whose stamp is of an edge
  TimesyncStatus trigger;        ///< where one is connected
};

class CameraThread {
 public:
  struct Setup {
    std::string name;  ///< "camera 0 (/dev/video0)"
    CameraDeviceSettings device;
    std::uint32_t first = 0;    ///< the rig's camera that it is, or that its left half is
    bool side_by_side = false;  ///< its right half is the next one
    CamerasGroup settings;
    std::optional<TriggerGroup> trigger;
  };

  explicit CameraThread(const Setup& setup);

  DeviceFault open();
  /// What the camera took otherwise than it was asked; after open().
  [[nodiscard]] std::span<const DeviceFault> warnings() const { return device_.warnings(); }
  void run(SensorSink& sink, const RunControl& control);
  /// Of run(), at each turn.
  [[nodiscard]] Heartbeat& heart() { return heart_; }

  /// Where the trigger's thread leaves its edges.
  [[nodiscard]] EdgeRing& edges() { return edges_; }
  [[nodiscard]] DeviceJournal& journal() { return journal_; }
  [[nodiscard]] const CameraFacts& facts() const { return device_.facts(); }
  [[nodiscard]] CameraStatus status() const {
    CameraStatus status;
    static_cast<void>(status_.read(status));
    return status;
  }
  /// Any thread: images handed over.
  [[nodiscard]] std::uint64_t taken() const { return status().counters.frames; }

 private:
  /// Frames that wait from before the flight.
  void discard();
  void takeEdges();
  void takeFrames(SensorSink& sink);
  void publish();
  void hand(const CapturedFrame& frame, SensorSink& sink);
  /// False: an image that is none.
  bool watchQuality(const CapturedFrame& frame);
  [[nodiscard]] Stamp middleOfExposure(const CapturedFrame& frame);

  Setup setup_;
  CameraDevice device_;
  Heartbeat heart_;
  DeviceJournal journal_;
  Duration longest_silence_;
  ExposureTiming timing_;
  EdgeRing edges_;
  EdgeTrain train_;
  std::optional<TriggerMatcher> matcher_;  ///< where a trigger is connected
  RateWatch rate_;
  ImageWatch images_;
  int odd_images_ = 0;     ///< dark or repeated, running
  Stamp newest_;           ///< arrival of the newest frame, or since when there is none
  CameraCounters before_;  ///< when the flight began
  bool any_ = false;       ///< a frame was handed over
  CameraStatus counted_;
  NewestShared<CameraStatus> status_;
};

}  // namespace swiftlet
