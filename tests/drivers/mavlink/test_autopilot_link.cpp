// What goes to an autopilot and when, in simulated time, read by our own parser.

#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "drivers/mavlink/autopilot_link.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr Duration kLinkStep = Duration::fromMilliseconds(1);
constexpr Stamp kBegin{50'000'000'000};

/// The autopilot's side: everything that it heard.
struct Autopilot {
  std::vector<mavlink::Odometry> poses;
  std::vector<Stamp> pose_times;
  std::vector<mavlink::Heartbeat> beats;
  std::vector<mavlink::Timesync> answers;
  std::vector<std::string> texts;  ///< joined
  std::vector<int> chunks;         ///< of each
  std::uint16_t text_id = 0;       ///< of the newest
  MavlinkParser parser;

  void hear(std::span<const std::uint8_t> bytes, Stamp now) {
    REQUIRE(parser.feed(bytes, now, Duration{}) == bytes.size());
    MavlinkFrame frame;
    while (parser.next(frame)) {
      mavlink::Odometry pose;
      mavlink::Heartbeat beat;
      mavlink::Timesync answer;
      if (mavlink::read(frame, pose)) {
        poses.push_back(pose);
        pose_times.push_back(now);
      }
      if (mavlink::read(frame, beat)) beats.push_back(beat);
      if (mavlink::read(frame, answer)) answers.push_back(answer);
      mavlink::StatusText text;
      if (!mavlink::read(frame, text)) continue;
      if (text.chunk == 0) {
        texts.emplace_back();
        chunks.push_back(0);
        REQUIRE((text.id == 0 || text.id != text_id));
        text_id = text.id;
      }
      REQUIRE(text.id == text_id);
      REQUIRE(text.chunk == chunks.back()++);
      texts.back() += text.text;
    }
  }
};

/// Time, millisecond by millisecond, with states at 200 Hz that come 3 ms after their stamps.
class Flight {
 public:
  AutopilotLink link{AutopilotLinkSettings{}};
  Autopilot autopilot;
  Stamp now = kBegin;
  Health health = Health::kGood;
  std::uint32_t epoch = 0;
  bool states_come = true;

  /// The autopilot says what it is.
  void beat(std::uint8_t kind) {
    mavlink::Heartbeat heartbeat;
    heartbeat.autopilot = kind;
    std::array<std::uint8_t, kLongestMavlinkFrame> bytes;
    const std::size_t length = mavlink::write(sender_, heartbeat, bytes);
    link.receive(std::span(bytes).first(length), now, Duration{});
  }

  void fly(Duration time) {
    for (const Stamp end = now + time; now < end; now = now + kLinkStep) {
      constexpr std::int64_t kStatePeriod = 5'000'000;
      if (states_come && (now - kBegin).ns % kStatePeriod == 0) {
        state_.stamp = now - Duration::fromMilliseconds(3);
        state_.T_world_body.translation.x() = (now - kBegin).seconds();
        any_ = true;
      }
      state_.health = health;
      state_.epoch = epoch;
      std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
      const std::size_t count = link.step(now, any_ ? &state_ : nullptr, Eigen::Vector3d::Zero(), bytes);
      autopilot.hear(std::span(bytes).first(count), now);
    }
  }

 private:
  MavlinkSender sender_;
  NavState state_;
  bool any_ = false;
};

TEST_CASE("Poses go out at the set rate, each once, with the stamp of its state", "[mavlink]") {
  Flight flight;
  flight.fly(Duration::fromMilliseconds(10'000));
  const auto& poses = flight.autopilot.poses;
  CHECK(std::abs(static_cast<double>(poses.size()) - 400) <= 8);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Stamp stamp{static_cast<std::int64_t>(poses[i].time_usec) * 1000};
    if (i > 0) REQUIRE(poses[i].time_usec > poses[i - 1].time_usec);
    REQUIRE(flight.autopilot.pose_times[i] - stamp <= Duration::fromMilliseconds(8));
    // The position is that of the stamp.
    REQUIRE(std::abs(poses[i].position.x() - (stamp - kBegin).seconds() - 0.003) < 1e-5);
    REQUIRE(poses[i].quality == 100);
    REQUIRE(poses[i].reset_counter == 0);
  }
  CHECK(flight.autopilot.beats.size() == 10);
  CHECK(flight.autopilot.beats.back().system_status == 4);
}

TEST_CASE("Before there is a state there are heartbeats and no poses", "[mavlink]") {
  Flight flight;
  flight.health = Health::kInitializing;
  flight.fly(Duration::fromMilliseconds(3'000));
  CHECK(flight.autopilot.poses.empty());
  CHECK(flight.autopilot.beats.size() == 3);
  CHECK(flight.autopilot.beats.back().system_status == 1);
}

TEST_CASE("A loss is told for a second, then nothing; what comes back has another reset counter",
          "[mavlink]") {
  const bool failed = GENERATE(true, false);
  Flight flight;
  flight.beat(mavlink::Heartbeat::kPx4);
  flight.fly(Duration::fromMilliseconds(2'000));
  const std::size_t before = flight.autopilot.poses.size();
  if (failed) {
    flight.health = Health::kFailed;
  } else {
    flight.states_come = false;
  }
  flight.fly(Duration::fromMilliseconds(5'000));
  const auto& poses = flight.autopilot.poses;
  const std::size_t told = poses.size() - before;
  CHECK(told > 35);
  CHECK(told < 46);
  for (std::size_t i = before + 1; i < poses.size(); ++i) {
    CHECK(poses[i].quality == -1);
    CHECK(std::isnan(poses[i].position.x()));
  }
  CHECK(flight.autopilot.pose_times.back() < kBegin + Duration::fromMilliseconds(3'500));
  CHECK(flight.autopilot.beats.back().system_status == 5);
  CHECK(flight.link.counters().losses == 1);
  flight.health = Health::kGood;
  flight.states_come = true;
  flight.fly(Duration::fromMilliseconds(1'000));
  CHECK(poses.back().quality == 100);
  CHECK(poses.back().reset_counter == 1);
  flight.epoch = 1;
  flight.fly(Duration::fromMilliseconds(1'000));
  CHECK(poses.back().reset_counter == 2);
  CHECK(flight.autopilot.beats.back().system_status == 4);
}

TEST_CASE("An autopilot that is not PX4, or not known, is told a loss by silence", "[mavlink]") {
  constexpr std::uint8_t kArduPilot = 3;  // MAV_AUTOPILOT_ARDUPILOTMEGA
  const bool known = GENERATE(true, false);
  Flight flight;
  if (known) {
    flight.beat(mavlink::Heartbeat::kPx4);
    flight.beat(kArduPilot);
    flight.beat(mavlink::Heartbeat::kNoAutopilot);  // another member of the network
  }
  flight.fly(Duration::fromMilliseconds(2'000));
  flight.health = Health::kFailed;
  flight.fly(Duration::fromMilliseconds(3'000));
  for (const mavlink::Odometry& pose : flight.autopilot.poses) REQUIRE(pose.quality == 100);
  CHECK(flight.link.counters().losses == 1);
  CHECK(flight.link.counters().lost_poses == 0);
  flight.health = Health::kGood;
  flight.fly(Duration::fromMilliseconds(1'000));
  CHECK(flight.autopilot.poses.back().reset_counter == 1);
}

TEST_CASE("The reset counter begins where it is told to, and wraps", "[mavlink]") {
  AutopilotLinkSettings settings;
  settings.first_reset = 255;
  AutopilotLink link(settings);
  Autopilot autopilot;
  NavState state;
  state.health = Health::kGood;
  for (const std::uint32_t epoch : {1U, 2U}) {
    state.epoch = epoch;
    state.stamp = kBegin + Duration::fromMilliseconds(100 * epoch);
    std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
    const std::size_t count = link.step(state.stamp, &state, Eigen::Vector3d::Zero(), bytes);
    autopilot.hear(std::span(bytes).first(count), state.stamp);
  }
  REQUIRE(autopilot.poses.size() == 2);
  CHECK(autopilot.poses[0].reset_counter == 255);
  CHECK(autopilot.poses[1].reset_counter == 0);
}

TEST_CASE("A state that comes late is not sent as new", "[mavlink]") {
  AutopilotLink link({});
  NavState state;
  state.health = Health::kGood;
  state.stamp = kBegin - AutopilotLink::kOldest - kLinkStep;
  std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
  static_cast<void>(link.step(kBegin, &state, Eigen::Vector3d::Zero(), bytes));
  CHECK(link.counters().poses == 0);
  CHECK(link.counters().too_old == 1);
}

TEST_CASE("A state of the future is not sent, and ends no later ones", "[mavlink]") {
  AutopilotLink link({});
  NavState state;
  state.health = Health::kGood;
  std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
  state.stamp = kBegin + Duration::fromMilliseconds(500);
  static_cast<void>(link.step(kBegin, &state, Eigen::Vector3d::Zero(), bytes));
  CHECK(link.counters().poses == 0);
  CHECK(link.counters().too_old == 1);
  state.stamp = kBegin;
  static_cast<void>(link.step(kBegin + kLinkStep, &state, Eigen::Vector3d::Zero(), bytes));
  CHECK(link.counters().poses == 1);
}

TEST_CASE("Obstacles that waited for the link are not sent as new", "[mavlink]") {
  for (const bool late : {false, true}) {
    AutopilotLink link({});
    mavlink::ObstacleDistance obstacles;
    obstacles.time_usec = static_cast<std::uint64_t>(kBegin.ns / 1000);
    link.show(obstacles);
    std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
    const Stamp now = kBegin + AutopilotLink::kOldestObstacles + (late ? kLinkStep : Duration{});
    static_cast<void>(link.step(now, nullptr, Eigen::Vector3d::Zero(), bytes));
    CHECK(link.counters().obstacles == (late ? 0 : 1));
  }
}

TEST_CASE("On a slow line nothing waits long, and poses come first", "[mavlink]") {
  struct Line {
    int baud;
    double poses, obstacles;  // Hz, at least
  };
  for (const Line& line : {Line{921'600, 39.5, 9.9}, Line{115'200, 39.5, 7}, Line{57'600, 20, 0}}) {
    INFO(line.baud << " baud");
    const Duration byte_time{10'000'000'000 / line.baud};
    AutopilotLink link({});
    link.knowLine(byte_time);
    Autopilot autopilot;
    MavlinkSender asker;
    std::array<std::uint8_t, kLongestMavlinkFrame> request;
    const std::size_t length = mavlink::write(asker, mavlink::Timesync{0, 1, 0, 0}, request);
    NavState state;
    state.health = Health::kGood;
    Stamp free = kBegin;  // when the line has sent all
    Duration oldest;      // of poses, with all that was written with them
    constexpr int kSeconds = 60;
    // As the thread does it: a round every 5 ms, states at 200 Hz that come 3 ms after their stamps.
    for (int round = 0; round < 200 * kSeconds; ++round) {
      const Stamp now = kBegin + Duration::fromMilliseconds(5 * round);
      state.stamp = now - Duration::fromMilliseconds(3);
      if (round % 20 == 0) {
        mavlink::ObstacleDistance seen;
        seen.time_usec = static_cast<std::uint64_t>(now.ns / 1000);
        link.show(seen);
        link.receive(std::span(request).first(length), now, byte_time);
      }
      if (round % 200 == 0) link.say(mavlink::StatusText::Severity::kInfo, "swiftlet: ready to arm");
      std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
      const std::uint64_t poses = link.counters().poses;
      const std::size_t count = link.step(now, &state, Eigen::Vector3d::Zero(), bytes);
      free = std::max(free, now) + Duration{static_cast<std::int64_t>(count) * byte_time.ns};
      autopilot.hear(std::span(bytes).first(count), now);
      if (link.counters().poses > poses) oldest = std::max(oldest, free - state.stamp);
    }
    CHECK(static_cast<double>(link.counters().poses) >= line.poses * kSeconds);
    CHECK(static_cast<double>(link.counters().obstacles) >= line.obstacles * kSeconds);
    CHECK(oldest < Duration::fromMilliseconds(100));
    CHECK(autopilot.texts.size() >= kSeconds - 1);
    CHECK(autopilot.answers.size() >= 10 * kSeconds - 1);
    CHECK((link.counters().held_back > 0) == (line.baud < 200'000));
  }
}

TEST_CASE("TIMESYNC is answered with our clock and the asker's stamp, at once", "[mavlink]") {
  Flight flight;
  flight.fly(Duration::fromMilliseconds(100));
  MavlinkSender asker;
  asker.system = 7;
  asker.component = 1;
  std::array<std::uint8_t, kLongestMavlinkFrame> bytes;
  const mavlink::Timesync request{0, 123'456'789, 0, 0};
  const std::size_t length = mavlink::write(asker, request, bytes);
  flight.link.receive(std::span(bytes).first(length), flight.now, Duration{});
  const Stamp asked = flight.now;
  flight.fly(kLinkStep);
  REQUIRE(flight.autopilot.answers.size() == 1);
  const mavlink::Timesync& answer = flight.autopilot.answers[0];
  CHECK(answer.ts1 == request.ts1);
  CHECK(answer.tc1 == asked.ns);
  CHECK(answer.target_system == 7);
  CHECK(answer.target_component == 1);
  // An answer is no request.
  const mavlink::Timesync other{55, 66, 0, 0};
  flight.link.receive(std::span(bytes).first(mavlink::write(asker, other, bytes)), flight.now, Duration{});
  flight.fly(kLinkStep);
  CHECK(flight.autopilot.answers.size() == 1);
}

TEST_CASE("Texts are told one by one, the oldest of too many are dropped and counted", "[mavlink]") {
  Flight flight;
  for (int i = 0; i < 19; ++i) {
    flight.link.say(mavlink::StatusText::Severity::kWarning, "text " + std::to_string(i));
  }
  flight.fly(Duration::fromMilliseconds(50));
  REQUIRE(flight.autopilot.texts.size() == 16);
  CHECK(flight.autopilot.texts.front() == "text 3");
  CHECK(flight.autopilot.texts.back() == "text 18");
  CHECK(flight.link.counters().texts_dropped == 3);
}

TEST_CASE("Long texts go in chunks that a reader can join, short ones whole", "[mavlink]") {
  Flight flight;
  std::string letters;
  for (int i = 0; i < 300; ++i) letters += static_cast<char>('a' + i % 26);
  // Characters, and the messages that they take: the last of several is not full.
  const std::vector<std::pair<std::size_t, int>> lengths = {{1, 1},   {49, 1},  {50, 1},  {51, 2}, {99, 2},
                                                            {100, 3}, {130, 3}, {199, 4}, {300, 4}};
  for (const auto& [length, messages] : lengths) {
    flight.link.say(mavlink::StatusText::Severity::kWarning, letters.substr(0, length));
  }
  flight.fly(Duration::fromMilliseconds(50));
  REQUIRE(flight.autopilot.texts.size() == lengths.size());
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const auto& [length, messages] = lengths[i];
    CHECK(flight.autopilot.texts[i] == letters.substr(0, std::min(length, std::size_t{199})));
    CHECK(flight.autopilot.chunks[i] == messages);
  }
}

TEST_CASE("Random bytes from the autopilot change nothing of what is sent", "[mavlink]") {
  Flight flight;
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    std::array<std::uint8_t, 300> noise;
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random.next());
    flight.link.receive(noise, flight.now, Duration{});
    flight.fly(Duration::fromMilliseconds(10));
  }
  CHECK(std::abs(static_cast<double>(flight.autopilot.poses.size()) - 80) <= 3);
}

}  // namespace
}  // namespace swiftlet
