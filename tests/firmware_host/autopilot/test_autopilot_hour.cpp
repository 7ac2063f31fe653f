// An hour beside an autopilot whose clock drifts and steps, over a line that delays and loses, in simulated
// time: its HIGHRES_IMU comes in, is stamped as in flight by the exchange of clocks, and what is told of each
// state carries the time at which it was sensed.

#include <sys/eventfd.h>
#include <unistd.h>
#include <catch2/catch.hpp>

#include <cmath>
#include <deque>
#include <iostream>
#include <nlohmann/json.hpp>

#include "drivers/mavlink/autopilot_link.hpp"
#include "drivers/serial/imu_decoder.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "drivers/timesync/two_way_clock_map.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/inputs/devices/imu_thread.hpp"

namespace swiftlet {
namespace {

constexpr Duration kTick = Duration::fromMilliseconds(1);
constexpr int kHourTicks = 3'600'000;
constexpr int kSampleTicks = 5;
constexpr int kAskTicks = 100;
constexpr double kLoss = 0.05;
constexpr double kSkew = 60e-6;
/// One way: a constant, and a jitter that is never negative.
constexpr double kDelay = 2e-3;
constexpr double kMeanJitter = 1e-3;
/// Positions carry the number of the sample within this, in millimetres that a float holds exactly.
constexpr int kNumbers = 65'536;

/// What is on its way.
struct Wire {
  Random random;
  std::deque<std::pair<Stamp, std::vector<std::uint8_t>>> frames;
  Stamp last;

  void send(Stamp now, std::span<const std::uint8_t> bytes) {
    if (random.uniform() < kLoss) return;
    const double jitter = -kMeanJitter * std::log(1 - random.uniform());
    last = std::max(last, now + Duration::fromSeconds(kDelay + jitter));
    frames.emplace_back(last, std::vector<std::uint8_t>(bytes.begin(), bytes.end()));
  }
  template <typename Take>
  void deliver(Stamp now, Take&& take) {
    for (; !frames.empty() && frames.front().first <= now; frames.pop_front()) {
      take(frames.front().second, frames.front().first);
    }
  }
};

struct Figures {
  std::uint64_t poses = 0;
  double worst = 0;            ///< s, of a sent stamp
  std::uint64_t wrong = 0;     ///< by more than a millisecond
  double longest_silence = 0;  ///< s
  std::uint64_t good_seconds = 0;
};

/// The whole of it as a link of the project's own IMU thread: each receive() is one sample's time.
class Hour : public ImuLink, public SensorSink {
 public:
  explicit Hour(std::atomic<bool>& stop) : stop_(stop), fd_(eventfd(1, EFD_CLOEXEC)) {}
  ~Hour() override { ::close(fd_); }
  Figures figures;

  // ImuLink.
  DeviceFault open() override { return {}; }
  [[nodiscard]] bool isOpen() const override { return true; }
  [[nodiscard]] int fd() const override { return fd_; }
  DeviceFault receive(Stamp /*real*/) override {
    for (int i = 0; i < kSampleTicks; ++i) tick();
    if (ticks_ >= kHourTicks) stop_.store(true);
    return {};
  }
  bool next(ImuReading& reading) override { return decoder_.next(reading); }
  [[nodiscard]] std::uint64_t received() const override { return decoder_.counters().bytes; }
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const override {
    if (!exchange_.usable()) return std::nullopt;
    return exchange_.toHost(device);
  }
  [[nodiscard]] nlohmann::ordered_json counters() const override { return {}; }

  // SensorSink: the estimator, which passes stamps on.
  void takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) override {
    // It has a state after a second.
    if (ticks_ < 1000) return;
    state_.stamp = sample.stamp;
    state_.health = Health::kGood;
    state_.T_world_body.translation.x() = sample.accel.x() / 1000;
    any_ = true;
  }
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& /*image*/, const HostTimes& /*host*/) override {}

 private:
  [[nodiscard]] Stamp now() const { return {kBegin.ns + ticks_ * kTick.ns}; }

  /// The autopilot's clock; it steps forward, back, a little and by hours.
  [[nodiscard]] static Stamp autopilotClock(Stamp at) {
    static constexpr std::array<std::pair<int, double>, 6> kSteps = {
        {{600, 0.5}, {1200, -0.25}, {1800, 7200}, {2400, -7200}, {2900, 0.03}, {3300, -0.03}}};
    const double since = (at - kBegin).seconds();
    double offset = 500;
    for (const auto& [second, step] : kSteps) offset += since >= second ? step : 0;
    return {static_cast<std::int64_t>((offset + since * (1 + kSkew)) * 1e6) * 1000};  // whole microseconds
  }

  void tick() {
    ++ticks_;
    if (ticks_ % kSampleTicks == 0) senseImu();
    // The vehicle's computer.
    up_.deliver(now(), [&](const auto& bytes, Stamp at) {
      static_cast<void>(decoder_.feed(bytes, at, {}));
      link_.receive(bytes, at, {});
    });
    exchangeClocks();
    std::array<std::uint8_t, AutopilotLink::kMostBytes> out;
    const std::size_t count = link_.step(now(), any_ ? &state_ : nullptr, Eigen::Vector3d::Zero(), out);
    // A step may hold several messages, of which each may be lost.
    if (count > 0) down_.send(now(), std::span(out).first(count));
    judge(std::span(out).first(count));
    // The autopilot.
    down_.deliver(now(), [&](const auto& bytes, Stamp at) { answer(bytes, at); });
  }

  void senseImu() {
    sensed_.push_back(now());
    ImuReading reading;
    reading.device = autopilotClock(now());
    reading.gyro = Eigen::Vector3d::Zero();
    reading.accel = Eigen::Vector3d(static_cast<double>((sensed_.size() - 1) % kNumbers), 0, 9.81);
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame;
    up_.send(now(), std::span(frame).first(encodeMavlink(reading, autopilot_, frame)));
  }

  void exchangeClocks() {
    ReceivedMavlink received;
    while (decoder_.nextMavlink(received)) {
      const auto* time = std::get_if<mavlink::Timesync>(&received.message);
      if (time == nullptr || time->tc1 == 0 || time->ts1 != asked_.ns) continue;
      static_cast<void>(exchange_.add({asked_, Stamp{time->tc1}, received.arrival}));
    }
    if (ticks_ % kAskTicks != 0) return;
    asked_ = now();
    std::array<std::uint8_t, kLongestMavlinkFrame> frame;
    down_.send(now(),
               std::span(frame).first(mavlink::write(ours_, mavlink::Timesync{0, asked_.ns, 0, 0}, frame)));
  }

  void answer(std::span<const std::uint8_t> bytes, Stamp at) {
    REQUIRE(parser_.feed(bytes, at, {}) == bytes.size());
    for (MavlinkFrame frame; parser_.next(frame);) {
      mavlink::Timesync request;
      if (!mavlink::read(frame, request) || request.tc1 != 0) continue;
      std::array<std::uint8_t, kLongestMavlinkFrame> out;
      request.tc1 = autopilotClock(at).ns;
      up_.send(at, std::span(out).first(mavlink::write(autopilot_, request, out)));
    }
  }

  /// What was sent, before the line loses any.
  void judge(std::span<const std::uint8_t> bytes) {
    if (ticks_ % 1000 == 0) {
      // A second counts where its messages came at the rate, one more or less.
      figures.good_seconds += in_second_ + 1 >= 40 ? 1 : 0;
      in_second_ = 0;
    }
    if (bytes.empty()) return;
    REQUIRE(sent_.feed(bytes, now(), {}) == bytes.size());
    for (MavlinkFrame frame; sent_.next(frame);) {
      mavlink::Odometry pose;
      if (!mavlink::read(frame, pose) || pose.quality < 0) continue;
      ++figures.poses;
      ++in_second_;
      figures.longest_silence = std::max(figures.longest_silence, (now() - spoke_).seconds());
      spoke_ = now();
      const Stamp truth = sensedAs(static_cast<int>(std::lround(pose.position.x() * 1000)));
      const double error = std::abs(static_cast<double>(pose.time_usec) * 1e-6 - (truth - Stamp{}).seconds());
      figures.worst = std::max(figures.worst, error);
      if (error > 1e-3) ++figures.wrong;
    }
  }

  /// When the newest sample with this number was sensed.
  [[nodiscard]] Stamp sensedAs(int number) const {
    const auto newest = static_cast<int>(sensed_.size() - 1);
    const int back = ((newest - number) % kNumbers + kNumbers) % kNumbers;
    return sensed_.at(static_cast<std::size_t>(newest - back));
  }

  static constexpr Stamp kBegin{90'000'000'000};
  std::atomic<bool>& stop_;
  int fd_;
  std::int64_t ticks_ = 0;
  std::vector<Stamp> sensed_;
  Wire up_{Random(1), {}, {}};
  Wire down_{Random(2), {}, {}};
  MavlinkSender autopilot_{.system = 1, .component = 1};
  MavlinkSender ours_;
  MavlinkParser parser_, sent_;
  ImuDecoder decoder_{ImuProtocol::kMavlink};
  TwoWayClockMap exchange_;
  Stamp asked_;
  AutopilotLink link_{AutopilotLinkSettings{}};
  NavState state_;
  bool any_ = false;
  Stamp spoke_{kBegin};
  std::uint64_t in_second_ = 0;
};

TEST_CASE("An hour with losses and clock steps: stamps within a millisecond, hardly a silence",
          "[autopilot]") {
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  auto owned = std::make_unique<Hour>(stop);
  Hour& hour = *owned;
  ImuThread imu("IMU", std::move(owned), ImuCorrection{}, {});
  imu.run(hour, {}, control);
  const Figures& f = hour.figures;
  std::cout << f.poses << " poses in an hour, worst stamp " << 1e3 * f.worst << " ms off, " << f.wrong
            << " beyond 1 ms; longest silence " << f.longest_silence << " s; at the rate in "
            << f.good_seconds << " of 3600 s\n";
  CHECK(static_cast<double>(f.poses) > 0.95 * 3600 * 40);
  CHECK(f.wrong == 0);
  CHECK(f.longest_silence <= 10);
  CHECK(static_cast<double>(f.good_seconds) >= 0.95 * 3600);
}

}  // namespace
}  // namespace swiftlet
