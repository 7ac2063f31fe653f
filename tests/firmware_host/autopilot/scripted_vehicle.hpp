#pragma once
// A scripted run for the autopilot's thread, and what an autopilot at the other end of the port heard of it.

#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/mavlink/mavlink_link.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "drivers/mavlink/vision_messages.hpp"
#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"

namespace swiftlet::test {

/// What the autopilot heard.
struct Heard {
  std::vector<mavlink::Odometry> poses;
  std::vector<mavlink::ObstacleDistance> obstacles;
  std::vector<mavlink::Timesync> answers;
  std::vector<std::string> texts;
  std::vector<mavlink::Heartbeat> heartbeats;
  MavlinkParser parser;

  void take(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
      bytes = bytes.subspan(parser.feed(bytes, {}, {}));
      for (MavlinkFrame frame; parser.next(frame);) {
        mavlink::Odometry pose;
        mavlink::ObstacleDistance obstacle;
        mavlink::Timesync answer;
        if (mavlink::read(frame, pose)) poses.push_back(pose);
        if (mavlink::read(frame, obstacle)) obstacles.push_back(obstacle);
        if (mavlink::read(frame, answer)) answers.push_back(answer);
        mavlink::StatusText text;
        if (mavlink::read(frame, text)) {
          if (text.chunk == 0) texts.emplace_back();
          texts.back() += text.text;
        }
        mavlink::Heartbeat beat;
        if (mavlink::read(frame, beat)) heartbeats.push_back(beat);
      }
    }
  }
};

/// A vehicle that moves along x at 1 m/s, with states every 5 ms.
struct Vehicle {
  LiveOutlet outlet;
  Verdict verdict;
  Stamp begin = monotonicNow();
  Duration clock{};  ///< of the run's stamps before CLOCK_MONOTONIC

  void move(Health health = Health::kGood) {
    moveUnsupervised(health);
    supervise();
  }
  void moveUnsupervised(Health health = Health::kGood) {
    NavState state;
    const Stamp now = monotonicNow();
    state.stamp = now - clock;
    state.health = health;
    state.T_world_body.translation.x() = (now - begin).seconds();
    outlet.state.write({state, Eigen::Vector3d::Zero()});
  }
  /// A triangle at x = 9 m, of now.
  void showWall() {
    LocalMesh& mesh = outlet.mesh.draft();
    mesh = {};
    mesh.stamp = monotonicNow() - clock;
    for (const Eigen::Vector3f& p : {Eigen::Vector3f(9, -1, -1), {9, 1, -1}, {9, 0, 1}}) {
      static_cast<void>(mesh.vertices.tryPushBack({0, p, 0}));
    }
    static_cast<void>(mesh.faces.tryPushBack({{0, 1, 2}, kNoLabel}));
    outlet.mesh.publish();
  }
  /// The verdict as it was, of now.
  void supervise() {
    verdict.evaluated = monotonicNow();
    outlet.verdict.write(verdict);
  }
  void say(const char* what) {
    verdict.arming = {};
    if (*what != 0) {
      MissingCondition missing;
      missing.condition = ArmingCondition::kSensors;
      std::snprintf(missing.text.data(), missing.text.size(), "%s", what);
      static_cast<void>(verdict.arming.missing.tryPushBack(missing));
    }
    ++verdict.arming_changes;
    supervise();
  }
  void tellHealth(Health health) {
    verdict.health = health;
    supervise();
  }
  /// No other trouble but this; none where `condition` is ok.
  void tellTrouble(const char* member, Condition condition, const char* text,
                   Health effect = Health::kDegraded) {
    verdict.troubles.clear();
    Trouble trouble;
    std::snprintf(trouble.member.data(), trouble.member.size(), "%s", member);
    std::snprintf(trouble.text.data(), trouble.text.size(), "%s", text);
    trouble.condition = condition;
    trouble.effect = effect;
    if (condition != Condition::kOk) static_cast<void>(verdict.troubles.tryPushBack(trouble));
    ++verdict.trouble_changes;
    supervise();
  }
};

/// Lets `seconds` pass in steps of a state; `each` sees every one.
template <typename Each>
void pass(double seconds, Each&& each) {
  const Stamp end = monotonicNow() + Duration::fromSeconds(seconds);
  while (monotonicNow() < end) {
    each();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

/// As long as it takes, on a machine under load too; false: it never was so.
template <typename IsSo, typename Each>
bool until(IsSo&& is_so, Each&& each) {
  const Stamp end = monotonicNow() + Duration::fromMilliseconds(20'000);
  while (!is_so() && monotonicNow() < end) {
    each();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return is_so();
}

/// What comes `rate` times a second can have come so often since `begin`, the first at once.
inline std::size_t mostSince(Stamp begin, double rate) {
  return static_cast<std::size_t>((monotonicNow() - begin).seconds() * rate) + 2;
}

inline AutopilotThreadOptions optionsOf(const std::string& device) {
  AutopilotThreadOptions options;
  options.settings.device = device;
  return options;
}

}  // namespace swiftlet::test
