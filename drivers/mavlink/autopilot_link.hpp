#pragma once
// Decides what is sent to an autopilot and when: heartbeat, the newest pose at a set rate, answers to its
// TIMESYNC, obstacles, texts.
//
// Only bytes in and bytes out; the owner of the port calls step() more often than the rate, with the clock.
// - A pose is sent once, with the stamp of its state (CLOCK_MONOTONIC, which the autopilot knows from the
//   answers to TIMESYNC), never older than kOldest or ahead of the clock by more than kMostAhead, and only
//   while health is good or degraded.
// - A serial line accepts more than it sends, and what waits in it grows old. Nothing but heartbeats and
//   answers is written while it holds more than kMostWaiting, and obstacles only if the next pose will not
//   wait longer.
// - Lost means failed health, or no new state for kSilence. Then no pose is sent, because an autopilot would
//   fly on a repeated old pose. Only PX4 is told at once, by poses with quality -1 and NaN values for
//   kTellLoss; versions of ArduPilot that do not read `quality` would use the values.
// - reset_counter begins at the given number. It increases with every epoch and when poses start again after
//   a loss.
// Memory: 8 kB inside the object, no allocation. Cost: about 5 us per pose. Source: docs/mavlink.md; PX4
// guide "External Position Estimation".

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/mavlink/autopilot_pose.hpp"
#include "drivers/mavlink/mavlink_link.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "drivers/mavlink/vision_messages.hpp"
#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {

struct AutopilotLinkSettings {
  double rate = 40;                ///< Hz of poses; autopilots expect 30 to 50
  bool position_estimate = false;  ///< send VISION_POSITION_ESTIMATE instead of ODOMETRY
  AutopilotMounting mounting;
  std::uint8_t system = 1;  ///< system id of the vehicle
  /// reset_counter of the first poses. Choose a value other than the previous process's, so that the
  /// autopilot sees a restart in flight as a reset.
  std::uint8_t first_reset = 0;
};

struct AutopilotLinkCounters {
  std::uint64_t poses = 0;
  std::uint64_t lost_poses = 0;  ///< poses with quality -1
  std::uint64_t losses = 0;
  std::uint64_t too_old = 0;    ///< states too old to be sent, or ahead of the clock
  std::uint64_t held_back = 0;  ///< poses that were due while the line was full; a later state follows
  std::uint64_t timesync_answers = 0;
  std::uint64_t obstacles = 0;  ///< messages sent
  std::uint64_t texts_dropped = 0;
};

class AutopilotLink {
 public:
  static constexpr Duration kOldest = Duration::fromMilliseconds(100);
  /// The error of a clock that is mapped to this computer's.
  static constexpr Duration kMostAhead = Duration::fromMilliseconds(20);
  /// Most time that bytes wait in the line: less than a pose's period.
  static constexpr Duration kMostWaiting = Duration::fromMilliseconds(20);
  static constexpr Duration kOldestObstacles = Duration::fromMilliseconds(500);
  static constexpr Duration kSilence = Duration::fromMilliseconds(300);
  static constexpr Duration kTellLoss = Duration::fromMilliseconds(1000);
  /// A heartbeat, a pose, obstacles, an answer and a text in one step.
  static constexpr std::size_t kMostBytes = 5 * kLongestMavlinkFrame;
  /// Characters per text: four chunks, the last not full, which marks the end.
  static constexpr std::size_t kMostText = 199;

  explicit AutopilotLink(const AutopilotLinkSettings& settings);

  /// Sets whether the autopilot is PX4, for one heard on another link; receive() detects it by itself.
  void knowPx4(bool px4) { px4_ = px4; }
  /// Sets the time that the line takes for a byte; 0 (default): it holds nothing back, as UDP.
  void knowLine(Duration byte_time) { byte_time_ = byte_time; }
  /// Takes bytes from the autopilot; parameters as in MavlinkParser::feed().
  void receive(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time);
  /// Sends a text once, in chunks of 50 characters, cut to kMostText. Beyond kTexts the oldest texts are
  /// dropped.
  void say(mavlink::StatusText::Severity severity, std::string_view text);

  /// Sends obstacles once, as soon as the line has room, or never if that is later than kOldestObstacles
  /// after them: autopilots take their arrival for their time.
  void show(const mavlink::ObstacleDistance& obstacles) { obstacles_ = obstacles; }

  /// Writes what is due at `now` and returns the number of bytes, usually 0. `state`: the newest, or null.
  std::size_t step(Stamp now, const NavState* state, const Eigen::Vector3d& omega_body,
                   std::span<std::uint8_t, kMostBytes> out);

  [[nodiscard]] const AutopilotLinkCounters& counters() const { return counters_; }
  [[nodiscard]] const StreamCounters& received() const { return parser_.counters(); }

 private:
  static constexpr std::size_t kTexts = 16;
  struct Text {
    mavlink::StatusText::Severity severity = mavlink::StatusText::Severity::kInfo;
    std::array<char, kMostText> text = {};
    std::size_t length = 0;
    std::size_t told = 0;  ///< characters already sent
  };

  std::size_t answerTimesync(std::span<std::uint8_t> out);
  std::size_t beat(Stamp now, const NavState* state, std::span<std::uint8_t> out);
  std::size_t tellPose(Stamp now, const NavState* state, const Eigen::Vector3d& omega_body,
                       std::span<std::uint8_t> out);
  std::size_t tellObstacles(Stamp now, std::span<std::uint8_t> out);
  std::size_t tellText(Stamp now, std::span<std::uint8_t> out);
  std::size_t writePose(const NavState& state, const Eigen::Vector3d& omega_body,
                        std::span<std::uint8_t> out);
  std::size_t writeLoss(Stamp now, std::span<std::uint8_t> out);
  /// What is handed over at `now` leaves the line after all that waits there.
  std::size_t onLine(Stamp now, std::size_t bytes);
  [[nodiscard]] Stamp lineFree(Stamp now, std::size_t bytes = 0) const;

  AutopilotLinkSettings settings_;
  Duration period_;
  MavlinkSender sender_;
  MavlinkParser parser_;
  FixedVector<mavlink::Timesync, 4> asked_;  ///< requests waiting for an answer
  FixedVector<Text, kTexts> texts_;
  std::uint16_t text_id_ = 0;
  std::optional<mavlink::ObstacleDistance> obstacles_;
  Duration byte_time_;
  Stamp line_free_;       ///< when all bytes handed over have left the line
  bool holding_ = false;  ///< a pose is due and held back
  bool px4_ = false;      ///< from the newest HEARTBEAT of an autopilot
  bool any_ = false;      ///< a pose was sent
  bool lost_ = false;     ///< the state was lost since then
  Stamp lost_since_;
  Stamp sent_;   ///< stamp of the newest state sent
  Stamp fresh_;  ///< when a newer state was last available
  Stamp next_pose_;
  Stamp next_beat_;
  std::uint32_t epoch_ = 0;
  std::uint8_t resets_ = 0;
  AutopilotLinkCounters counters_;
};

}  // namespace swiftlet
