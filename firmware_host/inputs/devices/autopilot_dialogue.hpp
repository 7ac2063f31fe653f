#pragma once
// Dialogue with an autopilot that is the IMU, besides its samples: TIMESYNC in both directions, and requests
// for the sample rate. Inputs: events of the decoder and the clock. Output: bytes.
//
// It sends as MAV_COMP_ID_ONBOARD_COMPUTER. Sequence numbers are counted per component; those of the outlet's
// component (drivers/mavlink/autopilot_link.hpp), which may share the link, belong to another thread. Memory:
// fixed, no allocation. Threads: one.

#include <cstdint>
#include <optional>
#include <span>

#include "drivers/mavlink/imu_stream_request.hpp"
#include "drivers/serial/imu_decoder.hpp"
#include "drivers/timesync/two_way_clock_map.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class AutopilotDialogue {
 public:
  /// TIMESYNC answers per round: an autopilot sends ten requests a second.
  static constexpr std::size_t kMostAnswers = 4;
  /// The answers, one TIMESYNC request and one command.
  static constexpr std::size_t kMostBytes = (kMostAnswers + 2) * kLongestMavlinkFrame;

  /// `rate`: required sample rate [Hz]; 0: not requested.
  explicit AutopilotDialogue(double rate) : stream_(rate) {}

  /// Takes what the decoder has received and sets which message it decodes; call after its samples have been
  /// taken. Writes the bytes to send at `now` (CLOCK_MONOTONIC) and returns their number.
  std::size_t step(ImuDecoder& decoder, Stamp now, std::span<std::uint8_t, kMostBytes> out);
  /// Call after the link was lost.
  void restart();

  /// Converts a stamp of the autopilot's clock to the host's; empty: not certain yet.
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const;
  /// Whether the newest HEARTBEAT of an autopilot came from PX4.
  [[nodiscard]] bool px4() const { return px4_; }
  [[nodiscard]] std::uint64_t answers() const { return answers_; }
  [[nodiscard]] std::uint64_t requests() const { return requests_; }
  [[nodiscard]] ImuStreamRequest& stream() { return stream_; }
  [[nodiscard]] const ImuStreamRequest& stream() const { return stream_; }

 private:
  MavlinkSender sender_{.system = 1, .component = 191, .sequence = 0};
  TwoWayClockMap exchange_;
  std::uint8_t system_ = 0, component_ = 0;  ///< owner of the clock: the sender of the readings; 0: unknown
  bool px4_ = false;
  ImuStreamRequest stream_;
  Stamp asked_;                ///< when the newest request was sent; its answer repeats this stamp
  std::uint64_t samples_ = 0;  ///< samples of the decoder counted so far
  std::uint64_t answers_ = 0, requests_ = 0;
};

}  // namespace swiftlet
