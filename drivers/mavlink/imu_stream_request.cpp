#include "drivers/mavlink/imu_stream_request.hpp"

#include <algorithm>
#include <array>

namespace swiftlet {
namespace {

/// Time after a request before samples are counted.
constexpr Duration kSettling = Duration::fromMilliseconds(300);
constexpr Duration kWindow = Duration::fromMilliseconds(1000);
constexpr double kMore = 1.25;
constexpr double kMost = 2;
constexpr double kMicroseconds = 1e6;
/// Seconds without a reading after which another message is requested.
constexpr int kPatience = 3;

struct Choice {
  std::uint32_t message;
  const char* name;
};
constexpr std::array<Choice, 3> kChoices = {{{mavlink::HighresImu::kId, "HIGHRES_IMU"},
                                             {mavlink::ScaledImu::kRawId, "RAW_IMU"},
                                             {mavlink::ScaledImu::kScaledId, "SCALED_IMU"}}};

}  // namespace

std::uint32_t ImuStreamRequest::message() const { return kChoices.at(choice_).message; }
const char* ImuStreamRequest::messageName() const { return kChoices.at(choice_).name; }

void ImuStreamRequest::hear(const mavlink::Heartbeat& heartbeat, std::uint8_t system, std::uint8_t component,
                            Stamp now) {
  if (heartbeat.autopilot == mavlink::Heartbeat::kNoAutopilot) return;
  if (system_ && (*system_ != system || component_ != component) && now - heartbeat_ < kGone) return;
  if (!system_ || now - heartbeat_ >= kGone) begin();
  system_ = system;
  component_ = component;
  heartbeat_ = now;
}

void ImuStreamRequest::hear(const mavlink::CommandAck& ack, std::uint8_t system) {
  if (ack.command != mavlink::CommandLong::kSetMessageInterval || system != system_) return;
  result_ = ack.result;
}

void ImuStreamRequest::begin() {
  choice_ = 0;
  factor_ = 1;
  misses_ = 0;
  ask_ = true;
}

std::optional<mavlink::CommandLong> ImuStreamRequest::step(Stamp now) {
  if (rate_ <= 0 || !system_ || now - heartbeat_ >= kGone) return std::nullopt;
  if (now <= window_) count_ = 0;  // still settling
  if (!ask_ && now - window_ >= kWindow) judge(now);
  if (!ask_) return std::nullopt;
  ask_ = false;
  result_.reset();
  window_ = now + kSettling;
  count_ = 0;
  asked_ = factor_ * rate_;
  mavlink::CommandLong command;
  command.command = mavlink::CommandLong::kSetMessageInterval;
  command.param[0] = static_cast<float>(message());
  command.param[1] = static_cast<float>(kMicroseconds / asked_);
  command.target_system = *system_;
  command.target_component = component_;
  return command;
}

/// Judges the second that has passed.
void ImuStreamRequest::judge(Stamp now) {
  seen_ = static_cast<double>(count_) / (now - window_).seconds();
  window_ = now;
  count_ = 0;
  if (seen_ >= kReached * rate_) {
    misses_ = 0;
    told_ = false;
    return;
  }
  ++misses_;
  ask_ = true;
  const bool refused =
      result_ && *result_ != mavlink::CommandAck::kAccepted && *result_ != mavlink::CommandAck::kInProgress;
  if (seen_ <= 0 && (refused || misses_ >= kPatience)) return takeNextMessage();
  if (seen_ <= 0 || misses_ == 1) return;
  const bool at_most = factor_ >= kMost;
  factor_ = std::min(kMore * factor_, kMost);
  if (!at_most || told_) return;
  told_ = true;
  remark_ =
      deviceFault(DeviceFaultKind::kChanged, 0, "%s: %.0f per second requested, %.0f received, %.0f required",
                  messageName(), asked_, seen_, rate_);
}

void ImuStreamRequest::takeNextMessage() {
  const char* before = messageName();
  choice_ = (choice_ + 1) % kChoices.size();
  factor_ = 1;
  misses_ = 0;
  remark_ = deviceFault(DeviceFaultKind::kChanged, 0, "no %s received, requesting %s", before, messageName());
}

bool ImuStreamRequest::nextRemark(DeviceFault& remark) {
  if (!remark_) return false;
  remark = *remark_;
  remark_.reset();
  return true;
}

}  // namespace swiftlet
