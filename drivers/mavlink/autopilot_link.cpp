#include "drivers/mavlink/autopilot_link.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace swiftlet {
namespace {

constexpr Duration kBeat = Duration::fromMilliseconds(1000);
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;

// MAV_STATE.
constexpr std::uint8_t kBooting = 1;
constexpr std::uint8_t kActive = 4;
constexpr std::uint8_t kCritical = 5;

bool usable(const NavState& state) {
  return state.health == Health::kGood || state.health == Health::kDegraded;
}

}  // namespace

AutopilotLink::AutopilotLink(const AutopilotLinkSettings& settings)
    : settings_(settings), period_(Duration::fromSeconds(1 / settings.rate)) {
  sender_.system = settings.system;
  resets_ = settings.first_reset;
}

void AutopilotLink::receive(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time) {
  while (!bytes.empty()) {
    bytes = bytes.subspan(parser_.feed(bytes, read_at, byte_time));
    MavlinkFrame frame;
    while (parser_.next(frame)) {
      mavlink::Heartbeat heartbeat;
      if (mavlink::read(frame, heartbeat) && heartbeat.autopilot != mavlink::Heartbeat::kNoAutopilot) {
        px4_ = heartbeat.autopilot == mavlink::Heartbeat::kPx4;
      }
      mavlink::Timesync request;
      if (!mavlink::read(frame, request) || request.tc1 != 0) continue;
      request.target_system = frame.system;
      request.target_component = frame.component;
      if (asked_.full()) asked_.erase(0);
      static_cast<void>(asked_.tryPushBack(request));
    }
  }
}

void AutopilotLink::say(mavlink::StatusText::Severity severity, std::string_view text) {
  if (texts_.full()) {
    texts_.erase(0);
    ++counters_.texts_dropped;
  }
  Text kept;
  kept.severity = severity;
  kept.length = std::min(text.size(), kept.text.size());
  std::copy_n(text.begin(), kept.length, kept.text.begin());
  static_cast<void>(texts_.tryPushBack(kept));
}

std::size_t AutopilotLink::step(Stamp now, const NavState* state, const Eigen::Vector3d& omega_body,
                                std::span<std::uint8_t, kMostBytes> out) {
  if (!asked_.empty()) asked_.front().tc1 = now.ns;
  std::size_t written = onLine(now, answerTimesync(out));
  written += onLine(now, beat(now, state, out.subspan(written)));
  written += onLine(now, tellText(now, out.subspan(written)));
  written += onLine(now, tellPose(now, state, omega_body, out.subspan(written)));
  return written + onLine(now, tellObstacles(now, out.subspan(written)));
}

Stamp AutopilotLink::lineFree(Stamp now, std::size_t bytes) const {
  return std::max(line_free_, now) + Duration{static_cast<std::int64_t>(bytes) * byte_time_.ns};
}

std::size_t AutopilotLink::onLine(Stamp now, std::size_t bytes) {
  line_free_ = lineFree(now, bytes);
  return bytes;
}

std::size_t AutopilotLink::answerTimesync(std::span<std::uint8_t> out) {
  if (asked_.empty()) return 0;
  const std::size_t length = mavlink::write(sender_, asked_.front(), out);
  asked_.erase(0);
  ++counters_.timesync_answers;
  return length;
}

std::size_t AutopilotLink::beat(Stamp now, const NavState* state, std::span<std::uint8_t> out) {
  if (now < next_beat_) return 0;
  next_beat_ = now + kBeat;
  mavlink::Heartbeat heartbeat;
  const bool begun = state != nullptr && state->health != Health::kInitializing;
  heartbeat.system_status = lost_ || (begun && !usable(*state)) ? kCritical : (begun ? kActive : kBooting);
  return mavlink::write(sender_, heartbeat, out);
}

std::size_t AutopilotLink::tellPose(Stamp now, const NavState* state, const Eigen::Vector3d& omega_body,
                                    std::span<std::uint8_t> out) {
  const bool newer = state != nullptr && usable(*state) && (!any_ || state->stamp > sent_);
  if (newer && now - state->stamp <= kOldest && state->stamp - now <= kMostAhead) fresh_ = now;
  const bool fresh = newer && fresh_ == now;
  if (any_ && !lost_ && ((state != nullptr && !usable(*state)) || now - fresh_ > kSilence)) {
    lost_ = true;
    lost_since_ = now;
    ++counters_.losses;
  }
  if (now < next_pose_) return 0;
  if (lineFree(now) - now > kMostWaiting) {
    if (fresh && !std::exchange(holding_, true)) ++counters_.held_back;
    return 0;
  }
  holding_ = false;
  if (!fresh) {
    if (newer) ++counters_.too_old;
    if (!lost_ || now - lost_since_ > kTellLoss) return 0;
    // VISION_POSITION_ESTIMATE has no quality field, and only PX4 is known to read ODOMETRY's: otherwise send
    // nothing.
    if (!px4_ || settings_.position_estimate) return 0;
    next_pose_ = now + period_;
    ++counters_.lost_poses;
    return writeLoss(now, out);
  }
  // Keeps the mean rate, but never sends two poses at once after a pause.
  next_pose_ = std::max(next_pose_ + period_, now + Duration{period_.ns / 2});
  if (any_ && (lost_ || state->epoch != epoch_)) ++resets_;
  any_ = true;
  lost_ = false;
  epoch_ = state->epoch;
  sent_ = state->stamp;
  ++counters_.poses;
  return writePose(*state, omega_body, out);
}

std::size_t AutopilotLink::writePose(const NavState& state, const Eigen::Vector3d& omega_body,
                                     std::span<std::uint8_t> out) {
  if (settings_.position_estimate) {
    mavlink::VisionPositionEstimate message = positionEstimateOf(state, settings_.mounting);
    message.reset_counter = resets_;
    return mavlink::write(sender_, message, out);
  }
  mavlink::Odometry message = odometryOf(state, omega_body, settings_.mounting);
  message.reset_counter = resets_;
  return mavlink::write(sender_, message, out);
}

std::size_t AutopilotLink::writeLoss(Stamp now, std::span<std::uint8_t> out) {
  mavlink::Odometry message;
  message.time_usec = static_cast<std::uint64_t>(now.ns / kNanosecondsPerMicrosecond);
  message.position.setConstant(kUnknown);
  message.q.fill(kUnknown);
  message.velocity.setConstant(kUnknown);
  message.rates.setConstant(kUnknown);
  message.pose_covariance.fill(kUnknown);
  message.velocity_covariance.fill(kUnknown);
  message.reset_counter = resets_;
  message.quality = mavlink::Odometry::kFailed;
  return mavlink::write(sender_, message, out);
}

std::size_t AutopilotLink::tellObstacles(Stamp now, std::span<std::uint8_t> out) {
  if (!obstacles_) return 0;
  const Stamp seen{static_cast<std::int64_t>(obstacles_->time_usec) * kNanosecondsPerMicrosecond};
  if (now - seen > kOldestObstacles) {
    obstacles_.reset();
    return 0;
  }
  const std::size_t length = mavlink::write(sender_, *obstacles_, out);
  if (lineFree(now, length) - std::max(now, next_pose_) > kMostWaiting) return 0;
  obstacles_.reset();
  ++counters_.obstacles;
  return length;
}

std::size_t AutopilotLink::tellText(Stamp now, std::span<std::uint8_t> out) {
  if (texts_.empty() || lineFree(now) - now > kMostWaiting) return 0;
  Text& text = texts_.front();
  mavlink::StatusText message;
  message.severity = text.severity;
  const std::string_view whole(text.text.data(), text.length);
  message.text = whole.substr(text.told, mavlink::StatusText::kMostText);
  if (text.length > mavlink::StatusText::kMostText) {
    if (text.told == 0 && ++text_id_ == 0) ++text_id_;  // 0 is used for texts in one piece
    message.id = text_id_;
    message.chunk = static_cast<std::uint8_t>(text.told / mavlink::StatusText::kMostText);
  }
  text.told += message.text.size();
  // Readers of chunks continue until one is not full.
  const bool more = message.id != 0 && message.text.size() == mavlink::StatusText::kMostText;
  const std::size_t length = mavlink::write(sender_, message, out);
  if (!more) texts_.erase(0);
  return length;
}

}  // namespace swiftlet
