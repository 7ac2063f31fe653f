// Which clock a sample's stamp is of, with a link that says what a test wants.

#include <sys/eventfd.h>
#include <unistd.h>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include <deque>

#include "firmware_host/inputs/devices/device_times.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"

namespace swiftlet::test {
namespace {

constexpr Duration kStep = Duration::fromMilliseconds(5);

/// Gives its readings one a round, each with what the exchange of clocks says then, and stops the run.
class ScriptedLink : public ImuLink {
 public:
  struct Round {
    ImuReading reading;
    std::optional<Duration> exchanged;  ///< host - device
    std::optional<TriggerEdge> edge;
  };

  ScriptedLink(std::deque<Round> rounds, std::atomic<bool>& stop)
      : rounds_(std::move(rounds)), stop_(stop), fd_(eventfd(1, EFD_CLOEXEC)) {}
  ~ScriptedLink() override { ::close(fd_); }

  DeviceFault open() override { return {}; }
  [[nodiscard]] bool isOpen() const override { return true; }
  [[nodiscard]] int fd() const override { return fd_; }
  DeviceFault receive(Stamp /*now*/) override {
    if (rounds_.empty()) {
      stop_.store(true);
      return {};
    }
    round_ = rounds_.front();
    rounds_.pop_front();
    waits_ = true;
    ++received_;
    return {};
  }
  bool next(ImuReading& reading) override {
    reading = round_.reading;
    return std::exchange(waits_, false);
  }
  bool nextEdge(TriggerEdge& edge) override {
    if (!round_.edge) return false;
    edge = *round_.edge;
    round_.edge.reset();
    return true;
  }
  [[nodiscard]] std::uint64_t received() const override { return received_; }
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const override {
    if (!round_.exchanged) return std::nullopt;
    return device + *round_.exchanged;
  }
  [[nodiscard]] nlohmann::ordered_json counters() const override { return {}; }

 private:
  std::deque<Round> rounds_;
  std::atomic<bool>& stop_;
  int fd_;
  Round round_;
  bool waits_ = false;
  std::uint64_t received_ = 0;
};

/// Samples sensed every 5 ms that arrive 2 ms later; the sensor's clock is 100 s behind.
constexpr Duration kBehind = Duration::fromMilliseconds(100'000);
constexpr Duration kTransport = Duration::fromMilliseconds(2);
constexpr Stamp kBegin = {500'000'000'000};
Stamp sensed(int i) { return {kBegin.ns + i * kStep.ns}; }

ScriptedLink::Round roundNumber(int i, std::optional<Duration> exchanged, Duration clock_step = {}) {
  ScriptedLink::Round round;
  round.reading.arrival = sensed(i) + kTransport;
  round.reading.device = sensed(i) - kBehind + clock_step;
  round.reading.gyro = round.reading.accel = Eigen::Vector3d::Zero();
  round.exchanged = exchanged;
  return round;
}

struct ScriptedFlight {
  KeepingSink sink;
  ImuStatus status;
  EdgeRing edges;
};

std::unique_ptr<ScriptedFlight> flyScript(std::deque<ScriptedLink::Round> rounds, Duration delay = {},
                                          const ImuEdges& wanted = {}) {
  auto flown = std::make_unique<ScriptedFlight>();
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  ImuThread imu("IMU", std::make_unique<ScriptedLink>(std::move(rounds), stop), ImuCorrection{}, delay);
  const std::array<EdgeRing*, 1> edges = {&flown->edges};
  ImuEdges choice = wanted;
  choice.cameras = edges;
  imu.run(flown->sink, choice, control);
  flown->status = imu.status();
  return flown;
}

TEST_CASE("one way alone, stamps hold the transport; by an exchange of clocks they do not") {
  std::deque<ScriptedLink::Round> rounds;
  for (int i = 0; i < 40; ++i) rounds.push_back(roundNumber(i, std::nullopt));
  for (int i = 40; i < 80; ++i) rounds.push_back(roundNumber(i, kBehind));
  const auto flown = flyScript(rounds);
  REQUIRE(flown->sink.count() == 80);
  for (int i = 0; i < 40; ++i)
    CHECK(flown->sink[static_cast<std::size_t>(i)].sample.stamp == sensed(i) + kTransport);
  for (int i = 40; i < 80; ++i) CHECK(flown->sink[static_cast<std::size_t>(i)].sample.stamp == sensed(i));
  CHECK(flown->status.by_exchange == 40);
  CHECK(flown->status.refused == 0);
}

TEST_CASE("an exchange that says a stamp of the future, or one far off, does not count") {
  for (const std::int64_t wrong_ms : {3LL, 3'600'000LL, -150LL}) {
    INFO(wrong_ms << " ms");
    std::deque<ScriptedLink::Round> rounds;
    for (int i = 0; i < 20; ++i)
      rounds.push_back(roundNumber(i, kBehind + Duration::fromMilliseconds(wrong_ms)));
    const auto flown = flyScript(rounds);
    CHECK(flown->sink.count() == 20);
    CHECK(flown->status.by_exchange == 0);
  }
}

TEST_CASE("a step of the clock that the exchange has not heard of shuts no later sample out") {
  std::deque<ScriptedLink::Round> rounds;
  for (int i = 0; i < 40; ++i) rounds.push_back(roundNumber(i, kBehind));
  // An hour ahead; the exchange says so 60 samples later.
  const Duration step = Duration::fromMilliseconds(3'600'000);
  for (int i = 40; i < 200; ++i) rounds.push_back(roundNumber(i, i < 100 ? kBehind : kBehind - step, step));
  const auto flown = flyScript(rounds);
  REQUIRE(flown->sink.count() > 180);
  for (std::size_t i = 0; i < flown->sink.count(); ++i)
    CHECK(flown->sink[i].sample.stamp <= flown->sink[i].arrival);
  CHECK(flown->sink[flown->sink.count() - 1].sample.stamp == sensed(199));
}

TEST_CASE("edges that the sensor tells of are mapped as its samples are") {
  constexpr Duration kDelay = Duration::fromMilliseconds(1);
  std::deque<ScriptedLink::Round> rounds;
  for (int i = 0; i < 60; ++i)
    rounds.push_back(roundNumber(i, i < 30 ? std::nullopt : std::optional(kBehind)));
  const auto edgeAt = [](int i) {
    TriggerEdge edge;
    edge.device = sensed(i) - kBehind;
    edge.counter = static_cast<std::uint64_t>(i);
    return edge;
  };
  rounds[10].edge = edgeAt(10);
  rounds[50].edge = edgeAt(50);
  const auto flown = flyScript(rounds, kDelay);
  EdgeMessage edge;
  for (const int i : {10, 50}) {
    REQUIRE(flown->edges.tryPop(edge));
    CHECK(edge.sequence == static_cast<std::uint64_t>(i));
    CHECK(edge.stamp == flown->sink[static_cast<std::size_t>(i)].sample.stamp);
  }
  CHECK_FALSE(flown->edges.tryPop(edge));
}

TEST_CASE("edges of the other polarity and of other lines do not reach the cameras") {
  const auto edgesOf = [](std::optional<bool> rising, const ImuEdges& wanted) {
    std::deque<ScriptedLink::Round> rounds;
    for (int i = 0; i < 60; ++i) rounds.push_back(roundNumber(i, kBehind));
    TriggerEdge edge;
    edge.device = sensed(50) - kBehind;
    edge.line = 2;
    edge.rising = rising;
    rounds[50].edge = edge;
    EdgeMessage found;
    return flyScript(rounds, {}, wanted)->edges.tryPop(found);
  };
  CHECK(edgesOf(true, {.rising = true}));
  CHECK_FALSE(edgesOf(false, {.rising = true}));
  CHECK_FALSE(edgesOf(true, {.rising = false}));
  CHECK(edgesOf(false, {.rising = false}));
  // A protocol that does not report the polarity: the sensor's own settings chose it.
  CHECK(edgesOf(std::nullopt, {.rising = false}));
  CHECK(edgesOf(true, {.line = 2}));
  CHECK_FALSE(edgesOf(true, {.line = 1}));
}

TEST_CASE("a sensor without a clock is stamped by arrival, less the delay") {
  constexpr Duration kDelay = Duration::fromMilliseconds(1);
  std::deque<ScriptedLink::Round> rounds;
  for (int i = 0; i < 10; ++i) {
    rounds.push_back(roundNumber(i, std::nullopt));
    rounds.back().reading.device.reset();
  }
  rounds[5].reading.arrival = rounds[4].reading.arrival;  // two in one read: the second would not rise
  const auto flown = flyScript(rounds, kDelay);
  CHECK(flown->sink.count() == 9);
  CHECK(flown->status.refused == 1);
  CHECK(flown->status.by_arrival == 10);
  CHECK(flown->sink[9 - 1].sample.stamp == sensed(9) + kTransport - kDelay);
}

}  // namespace
}  // namespace swiftlet::test
