#pragma once
// A flight of fifteen threads and four sensors under a simulated clock: everything is well until a test takes
// something away. The supervisor runs in it step by step; no thread, no sleep.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "firmware_host/supervisor/supervisor.hpp"

namespace swiftlet::test {

inline constexpr std::array<const char*, 15> kMembers = {
    "imu",  "camera0", "camera1", "trigger", "propagate", "track", "smooth", "mesh",
    "loop", "map",     "log",     "record",  "autopilot", "view",  "dds"};

/// All outlets are to say so within this time after the longest silence; the supervisor has a fifth of it.
inline constexpr double kSaidWithin = 0.5;  // s

struct SimulatedFlight {
  struct Told {
    double at;  ///< s since the start
    std::string text;
  };

  explicit SimulatedFlight(bool host_stamps = true, double speed = 1, SystemdNotify* systemd = nullptr,
                           std::optional<std::array<double, 3>> vehicle_up = {}, double camera_rate = 20)
      : stamps_on_host(host_stamps), image_turns(static_cast<std::uint64_t>(std::lround(200 / camera_rate))) {
    for (std::size_t i = 0; i < kMembers.size(); ++i) {
      hearts.push_back(std::make_unique<Heartbeat>());
      static_cast<void>(supervisor.add(kMembers[i], *hearts[i]));
    }
    FlightGround ground;
    ground.flight_threads = 4;
    ground.memory_locked = true;
    ground.imu_rate = 200;
    ground.speed = speed;
    ground.cameras = 2;
    ground.trigger = true;
    ground.recorder_wanted = true;
    ground.host_stamps = host_stamps;
    ground.vehicle_up = vehicle_up;
    ground.camera_rate = camera_rate;
    facts.recorder_running = true;
    facts.estimate.epoch = 1;
    supervisor.begin(
        ground, [this](FlightFacts& out) { out = facts; }, systemd);
    static_cast<void>(supervisor.addSink([this](const Verdict& v) { verdict = v; }));
    for (const auto& heart : hearts) heart->begin(now);
  }

  [[nodiscard]] Heartbeat& heart(std::string_view name) {
    return *hearts[static_cast<std::size_t>(std::find(kMembers.begin(), kMembers.end(), name) -
                                            kMembers.begin())];
  }
  /// Its loop stands from now on.
  void stall(std::string_view name) { stalled.push_back(name); }
  void resume(std::string_view name) { std::erase(stalled, name); }

  void pass(double seconds) {
    const Stamp end = now + Duration::fromSeconds(seconds);
    while (now < end) turn();
  }
  /// Seconds until the verdict says so, at most 30; 30: never.
  template <typename IsSo>
  double until(IsSo&& is_so) {
    const Stamp begin = now;
    while (!is_so() && (now - begin).seconds() < 30) turn();
    return (now - begin).seconds();
  }
  [[nodiscard]] double time() const { return (now - start).seconds(); }
  /// Events that begin so.
  [[nodiscard]] int times(std::string_view text) const {
    return static_cast<int>(std::count_if(told.begin(), told.end(),
                                          [&](const Told& line) { return line.text.starts_with(text); }));
  }
  [[nodiscard]] const Trouble* trouble(std::string_view name, Cause cause) const {
    for (const Trouble& one : verdict.troubles) {
      if (one.name() == name && one.cause == cause) return &one;
    }
    return nullptr;
  }

  Supervisor supervisor;
  std::vector<std::unique_ptr<Heartbeat>> hearts;
  FlightFacts facts;
  Verdict verdict;
  std::vector<Told> told;
  Stamp start{1'000'000'000'000};
  Stamp now = start;
  bool stamps_on_host;
  std::uint64_t image_turns;  ///< of 5 ms, between two images
  // What is switched off.
  std::vector<std::string_view> stalled;
  bool imu_silent = false, trigger_silent = false, no_states = false, no_frames = false;
  std::array<bool, kMaxCameras> camera_silent{};
  Duration stamp_shift;  ///< of all sensors' stamps

 private:
  static constexpr Duration kTurn = Duration::fromMilliseconds(5);
  static constexpr std::int64_t kLogEpoch = 1'400'000'000'000'000'000;  ///< of a log's clock, far away

  void turn() {
    now = now + kTurn;
    ++turns;
    const Stamp stamp = (stamps_on_host ? now : Stamp{kLogEpoch} + (now - start)) + stamp_shift;
    for (std::size_t i = 0; i < hearts.size(); ++i) {
      if (std::find(stalled.begin(), stalled.end(), std::string_view(kMembers[i])) == stalled.end()) {
        hearts[i]->beat(now);
      }
    }
    const auto deliver = [&](SensorNews& news) { news = {news.messages + 1, 0, stamp, now}; };
    EstimateNews& estimate = facts.estimate;
    if (!imu_silent) {
      deliver(facts.imu);
      if (!no_states) ++estimate.states;
    }
    if (turns % image_turns == 0) {
      bool any = false;
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        if (camera_silent[c]) continue;
        deliver(facts.camera[c]);
        any = true;
      }
      if (!trigger_silent) deliver(facts.trigger);
      if (any && !no_frames) {
        ++estimate.frames;
        estimate.frame = stamp;
        estimate.has_state = true;
        estimate.frame_health = estimate.state_health = Health::kGood;
      }
    }
    if (turns % 20 != 0) return;
    supervisor.step(now);
    supervisor.drainEvents([this](Stamp, const std::string& text) { told.push_back({time(), text}); });
  }

  std::uint64_t turns = 0;
};

}  // namespace swiftlet::test
