#pragma once
// What goes to an autopilot and when: heartbeat, the newest pose at a set rate, answers to its TIMESYNC,
// obstacles, texts.
//
// Bytes in, bytes out; whoever owns the port calls step() more often than the rate, with the clock.
// - A pose is sent once, with the stamp of its state (CLOCK_MONOTONIC, which the answers to TIMESYNC tell the
//   autopilot about), never older than kOldest, and only while health is good or degraded.
// - Lost: failed, or no new state for kSilence. Then silence: an autopilot that hears an old pose again flies
//   on it. PX4 alone hears of it at once, by poses of quality -1 without numbers for kTellLoss: versions of
//   ArduPilot that do not read `quality` would take the numbers.
// - reset_counter begins at the given number, and rises with every epoch and when poses begin anew after a
//   loss.
// Memory: 8 kB inside the object, no allocation. Cost: about 5 us a pose.
// Source: docs/mavlink.md; PX4 guide "External Position Estimation".

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
  bool position_estimate = false;  ///< VISION_POSITION_ESTIMATE in place of ODOMETRY
  AutopilotMounting mounting;
  std::uint8_t system = 1;  ///< the vehicle's
  /// reset_counter of the first poses: another one than the process before had, so that a restart in flight
  /// is a reset to the autopilot.
  std::uint8_t first_reset = 0;
};

struct AutopilotLinkCounters {
  std::uint64_t poses = 0;
  std::uint64_t lost_poses = 0;  ///< of quality -1
  std::uint64_t losses = 0;
  std::uint64_t too_old = 0;  ///< states that came too late to be sent
  std::uint64_t timesync_answers = 0;
  std::uint64_t obstacles = 0;  ///< messages
  std::uint64_t texts_dropped = 0;
};

class AutopilotLink {
 public:
  static constexpr Duration kOldest = Duration::fromMilliseconds(100);
  static constexpr Duration kSilence = Duration::fromMilliseconds(300);
  static constexpr Duration kTellLoss = Duration::fromMilliseconds(1000);
  /// A heartbeat, a pose, obstacles, an answer and a text at once.
  static constexpr std::size_t kMostBytes = 5 * kLongestMavlinkFrame;
  /// Characters of a text: four chunks, of which the last is not full: readers know the end by that.
  static constexpr std::size_t kMostText = 199;

  explicit AutopilotLink(const AutopilotLinkSettings& settings);

  /// Whether the autopilot is PX4, heard on another's link; receive() knows it by itself.
  void knowPx4(bool px4) { px4_ = px4; }
  /// What the autopilot sent; as MavlinkParser::feed.
  void receive(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time);
  /// Sent once, in chunks of 50 characters, cut to kMostText; beyond kTexts the oldest are dropped.
  void say(mavlink::StatusText::Severity severity, std::string_view text);

  /// Sent once, by the next step.
  void show(const mavlink::ObstacleDistance& obstacles) { obstacles_ = obstacles; }

  /// What is to be sent at `now`: bytes written, none for the most part. `state`: the newest, or null.
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
    std::size_t told = 0;  ///< characters
  };

  std::size_t answerTimesync(std::span<std::uint8_t> out);
  std::size_t beat(Stamp now, const NavState* state, std::span<std::uint8_t> out);
  std::size_t tellPose(Stamp now, const NavState* state, const Eigen::Vector3d& omega_body,
                       std::span<std::uint8_t> out);
  std::size_t tellObstacles(std::span<std::uint8_t> out);
  std::size_t tellText(std::span<std::uint8_t> out);
  std::size_t writePose(const NavState& state, const Eigen::Vector3d& omega_body,
                        std::span<std::uint8_t> out);
  std::size_t writeLoss(Stamp now, std::span<std::uint8_t> out);

  AutopilotLinkSettings settings_;
  Duration period_;
  MavlinkSender sender_;
  MavlinkParser parser_;
  FixedVector<mavlink::Timesync, 4> asked_;  ///< requests that wait for an answer
  FixedVector<Text, kTexts> texts_;
  std::uint16_t text_id_ = 0;
  std::optional<mavlink::ObstacleDistance> obstacles_;
  bool px4_ = false;   ///< by the newest HEARTBEAT of an autopilot
  bool any_ = false;   ///< a pose was ever sent
  bool lost_ = false;  ///< and since then the state was
  Stamp lost_since_;
  Stamp sent_;   ///< stamp of the newest state that was sent
  Stamp fresh_;  ///< when a newer one was last there
  Stamp next_pose_;
  Stamp next_beat_;
  std::uint32_t epoch_ = 0;
  std::uint8_t resets_ = 0;
  AutopilotLinkCounters counters_;
};

}  // namespace swiftlet
