#pragma once
// One camera of a hardware-in-the-loop replay: which image of the log is seen at which instant, and the
// effect of faults.

#include <optional>
#include <string>

#include "firmware_host/lab/hil/camera_player.hpp"
#include "firmware_host/lab/hil/fault_timeline.hpp"
#include "firmware_host/lab/hil/log_reader.hpp"

namespace swiftlet {

/// Image k of the log is shown at `first` + k periods of CLOCK_MONOTONIC.
struct FrameGrid {
  Stamp first;      ///< CLOCK_MONOTONIC
  Stamp first_log;  ///< the log's stamp of the same image
  Duration period;

  [[nodiscard]] Stamp instant(std::int64_t slot) const { return first + Duration{slot * period.ns}; }
  [[nodiscard]] Stamp toHost(Stamp log) const { return first + (log - first_log); }
  /// The slot of a log's stamp, and its distance from that slot.
  [[nodiscard]] std::int64_t slotOf(Stamp log) const {
    const std::int64_t since = (log - first_log).ns;
    return (since + (since >= 0 ? period.ns : -period.ns) / 2) / period.ns;
  }
  [[nodiscard]] Duration offGrid(Stamp log) const {
    const Duration off = toHost(log) - instant(slotOf(log));
    return off < Duration{} ? -off : off;
  }
};

class PlayedCamera {
 public:
  struct Counters {
    std::uint64_t shown = 0;
    std::uint64_t late = 0;     ///< omitted because they came after their instant
    std::uint64_t missing = 0;  ///< slots without an image in the log; the previous image is seen again
    std::uint64_t slipped = 0;  ///< checks at which the driver had taken more or fewer images than were due
  };

  PlayedCamera(std::size_t index, LogReader& reader, const FaultTimeline& faults)
      : index_(index),
        device_(index == 0 ? FaultDevice::kCamera0 : FaultDevice::kCamera1),
        reader_(reader),
        faults_(faults) {}

  DeviceFault open(const std::string& output, const std::string& capture, int width, int height);
  /// The log's first image, whose stamp defines the grid; empty: none.
  [[nodiscard]] const std::optional<LogReader::Image>& next() const { return next_; }
  /// Starts with black images, shows the log's images from slot 0 to `last_slot`, then black images again.
  void begin(const FrameGrid& grid, Stamp now, std::int64_t last_slot);

  /// Does what is due now. Returns an unplanned fault of the device.
  DeviceFault step(Stamp now);
  [[nodiscard]] bool ended() const { return slot_ > last_slot_; }
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  DeviceFault followFaults(Duration time);
  DeviceFault showSlot();
  DeviceFault damageNext(Stamp now);
  bool reopen();
  void watchSlips(Stamp now);

  std::size_t index_;
  FaultDevice device_;
  LogReader& reader_;
  const FaultTimeline& faults_;
  CameraPlayer player_;
  std::string output_, capture_;
  int width_ = 0, height_ = 0;
  std::optional<LogReader::Image> next_;
  std::optional<LogReader::Image> shown_;
  FrameGrid grid_;
  std::int64_t slot_ = 0;  ///< next slot to be written
  std::int64_t last_slot_ = 0;
  std::int64_t streamed_ = 0;  ///< first slot since the output was opened
  bool unplugged_ = false;
  bool stalled_ = false;
  std::int64_t looked_ = -1;   ///< last slot checked for slips
  std::int64_t decided_ = -1;  ///< slot for which a loss has been decided
  Counters counters_;
};

}  // namespace swiftlet
