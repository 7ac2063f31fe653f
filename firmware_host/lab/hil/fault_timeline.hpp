#pragma once
// Faults of a hardware-in-the-loop replay, read from a file with lines of
//   seconds after the first image, device, fault, duration in seconds, value
// for example `5.0,imu,stall,2.0` ('#' begins a comment; the value is optional).
//
// Faults by device, and what their value is where they have one:
//   imu      unplug       the port goes, the interface goes down, and returns
//            stall        nothing is sent
//            garbage      random bytes in place of messages; on a CAN bus nothing
//            drop         samples are lost; value: share of them, 0.5
//            clock_step   the sensor's clock jumps, once; value: seconds, 0.25
//   camera0, unplug       the node goes, and returns
//   camera1  stall        no frame comes
//            drop         frames are lost; value: share of them, 0.5
//            dark         images are black; value: grey value, 0
//            freeze       the same image again
//   trigger  drop         edges are lost; value: share of them, 0.5
//            glitch       two edges for one
//
// The same file gives the same faults: random choices use a seed derived from the line.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FaultDevice : std::uint8_t { kImu, kCamera0, kCamera1, kTrigger };
enum class PlannedFaultKind : std::uint8_t {
  kUnplug,
  kStall,
  kGarbage,
  kDrop,
  kClockStep,
  kDark,
  kFreeze,
  kGlitch,
};

std::string_view name(FaultDevice device);
std::string_view name(PlannedFaultKind kind);

struct PlannedFault {
  Duration begin;  ///< after the first image
  Duration length;
  FaultDevice device = FaultDevice::kImu;
  PlannedFaultKind kind = PlannedFaultKind::kStall;
  double value = 0;

  [[nodiscard]] bool covers(Duration time) const { return time >= begin && time < begin + length; }
};

class FaultTimeline {
 public:
  FaultTimeline() = default;
  /// InputError with line and field. `name` names the file in messages.
  static FaultTimeline parse(const std::string& name, std::string_view text);
  static FaultTimeline read(const std::string& path);

  [[nodiscard]] const std::vector<PlannedFault>& faults() const { return faults_; }
  /// The first fault of this kind that is active at `time`; null: none.
  [[nodiscard]] const PlannedFault* active(FaultDevice device, PlannedFaultKind kind, Duration time) const;
  /// Random decision for the n-th occasion, with probability `share`; depends only on the line and n.
  [[nodiscard]] bool strikes(const PlannedFault& fault, std::uint64_t n) const;
  /// Sum of the clock steps up to `time`.
  [[nodiscard]] Duration clockStep(Duration time) const;
  /// The list with one line per fault, ordered by beginning; the same for the same file.
  [[nodiscard]] std::string text() const;

 private:
  std::vector<PlannedFault> faults_;  ///< by begin
};

}  // namespace swiftlet
