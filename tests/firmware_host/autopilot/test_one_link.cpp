// IMU in and poses out over one link: a pseudo-terminal paced to 92 kB/s, UDP on the ports that PX4's
// simulator uses, and an hour in simulated time. The autopilot is
// tests/firmware_host/autopilot/far_autopilot.hpp.

#include <arpa/inet.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/mavlink/autopilot_link.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/inputs/devices/autopilot_dialogue.hpp"
#include "firmware_host/inputs/devices/imu_thread.hpp"
#include "firmware_host/inputs/devices/port_imu_link.hpp"
#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"
#include "tests/firmware_host/autopilot/far_autopilot.hpp"
#include "tests/firmware_host/autopilot/scripted_vehicle.hpp"
#include "tests/support/long_run.hpp"

namespace swiftlet::test {
namespace {

constexpr double kRate = 200;     ///< of the calibration
constexpr double kPoseRate = 40;  ///< autopilot.rate_hz
constexpr double kSettled = 10;   ///< s, until clocks are locked and the rate is there
constexpr double kStampLimit = 5e-4;

double percentile(std::vector<double> values, double share) {
  REQUIRE_FALSE(values.empty());
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Takes samples as the estimator would, and makes a state of each.
class StateSink : public SensorSink {
 public:
  explicit StateSink(std::function<void(const NavState&)> tell, double unit = 1)
      : unit_(unit), tell_(std::move(tell)) {}
  std::vector<std::pair<int, Stamp>> samples;  ///< number, stamp

  void takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) override {
    samples.emplace_back(static_cast<int>(std::lround(sample.accel.x() / unit_)), sample.stamp);
    NavState state;
    state.stamp = sample.stamp;
    state.health = Health::kGood;
    state.T_world_body.translation.x() = sample.accel.x() / unit_ / 1000;
    tell_(state);
  }
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& /*image*/, const HostTimes& /*host*/) override {}

 private:
  double unit_;  ///< of the first acceleration, which numbers the reading
  std::function<void(const NavState&)> tell_;
};

struct Judged {
  std::uint64_t lost = 0;
  /// In the first two seconds, where the clock's map may refuse samples if the first ones were late.
  std::uint64_t lost_early = 0;
  std::vector<double> errors;  ///< s, of the stamps, once settled
};

/// Samples beside the readings that were sent; the first that came says where they begin.
Judged judge(const StateSink& sink, const FarAutopilot& far, Stamp begin) {
  Judged judged;
  REQUIRE(sink.samples.size() > 100);
  // Readings of before the first sample were thrown away with what waited: fewer than the numbers.
  std::size_t index = static_cast<std::size_t>(sink.samples.front().first);
  int before = sink.samples.front().first - 1;
  for (const auto& [number, stamp] : sink.samples) {
    const int step =
        ((number - before) % FarAutopilot::kNumbers + FarAutopilot::kNumbers) % FarAutopilot::kNumbers;
    index += static_cast<std::size_t>(step);
    before = number;
    const Stamp truth = far.middles.at(index - 1);
    constexpr double kStart = 2;
    ((truth - begin).seconds() < kStart ? judged.lost_early : judged.lost) +=
        static_cast<std::uint64_t>(step - 1);
    if ((truth - begin).seconds() > kSettled) judged.errors.push_back(std::abs((stamp - truth).seconds()));
  }
  // What was sent last is still on its way.
  judged.lost += far.middles.size() - index > 20 ? far.middles.size() - index : 0;
  return judged;
}

void report(const char* name, double seconds, const Judged& judged, const StateSink& sink,
            const FarAutopilot& far, std::uint64_t pose_count) {
  std::vector<double> pose_errors(
      far.pose_errors.end() - static_cast<std::ptrdiff_t>(
                                  std::min<std::size_t>(far.pose_errors.size(), judged.errors.size() / 5)),
      far.pose_errors.end());
  std::cout << name << ": " << seconds << " s, " << sink.samples.size() << " samples, " << judged.lost
            << " lost, " << judged.lost_early << " more in the first two seconds; stamps off by p50 "
            << 1e3 * percentile(judged.errors, 0.5) << " ms, p99 " << 1e3 * percentile(judged.errors, 0.99)
            << " ms, worst " << 1e3 * percentile(judged.errors, 1) << " ms; " << pose_count << " poses, "
            << static_cast<double>(pose_count) / seconds << " a second, their stamps off by p99 "
            << 1e3 * percentile(pose_errors, 0.99) << " ms; " << far.garbled_bytes << " bytes garbled, "
            << far.sequence_gaps << " gaps; HIGHRES_IMU asked " << far.requests
            << " times; autopilot's own offset off by p50 " << 1e3 * percentile(far.clock_errors, 0.5)
            << " ms\n";
}

/// What is demanded of both ways.
void check(double seconds, const Judged& judged, const StateSink& sink, const FarAutopilot& far) {
  CHECK(judged.lost == 0);
  CHECK(percentile(judged.errors, 0.99) < kStampLimit);
  CHECK(far.garbled_bytes == 0);
  CHECK(far.sequence_gaps == 0);
  CHECK(far.poses_back == 0);
  CHECK(static_cast<double>(far.pose_times.size()) > 0.98 * kPoseRate * (seconds - 2));
  CHECK(static_cast<double>(far.pose_times.size()) < 1.02 * kPoseRate * seconds + 2);
  // The default is 50 a second: the rate was asked for and given.
  CHECK(static_cast<double>(sink.samples.size()) > 0.97 * kRate * (seconds - 3));
  CHECK(far.asked_interval == Approx(1 / kRate).epsilon(1e-3));
  CHECK(static_cast<double>(far.heard.at(0)) > 0.9 * (seconds - 2));   // HEARTBEAT
  CHECK(static_cast<double>(far.heard.at(111)) > 18 * (seconds - 2));  // TIMESYNC, asked and answered
}

/// The program's two threads of one link, and the autopilot at its far end, in real time.
template <typename Pump>
void fly(const char* name, const std::string& device, double seconds, FarAutopilot& far, Stamp begin,
         Pump&& pump) {
  ImuLinkGroup settings;
  settings.device = device;
  settings.protocol = "mavlink";
  LinkOutbox outbox;
  LiveOutlet outlet;
  StateSink sink([&](const NavState& state) { outlet.state.write({state, Eigen::Vector3d::Zero()}); });
  ImuThread imu("IMU", std::make_unique<PortImuLink>(settings, kRate, &outbox), ImuCorrection{}, {}, kRate);
  REQUIRE(imu.open().ok());
  AutopilotThreadOptions options = optionsOf(device);
  options.outbox = &outbox;
  auto autopilot = std::make_unique<AutopilotThread>(outlet, options);
  Verdict verdict;
  verdict.health = Health::kGood;
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  std::thread imu_thread([&] { imu.run(sink, {}, control); });
  auto next = std::chrono::steady_clock::now();
  const Stamp end = begin + Duration::fromSeconds(seconds);
  for (Stamp now = monotonicNow(); now < end; now = monotonicNow()) {
    verdict.evaluated = now;
    outlet.verdict.write(verdict);
    pump(now);
    // How often the far side looks at its port adds to one way's delay more than to the other's.
    next = std::max(next + std::chrono::microseconds(200), std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
  }
  const std::uint64_t poses = far.pose_times.size();
  stop.store(true);
  imu_thread.join();
  std::vector<std::string> lines;
  for (DeviceEvent event; imu.journal().next(event);) {
    const std::string line = imu.journal().text(event);
    // A clock that begins with samples which a busy machine kept jumps when the first ones come in time.
    if ((event.stamp - begin).seconds() > 2) lines.push_back(line);
    std::cout << line << "\n";
  }
  autopilot->drainEvents([&](Stamp /*stamp*/, const std::string& line) { lines.push_back(line); });
  autopilot->tellEnd();
  const nlohmann::ordered_json told = autopilot->finish();
  CHECK(told.at("writes_refused") == 0);
  for (const std::string& line : lines) {
    // A machine that stands still for a tenth of a second makes one second poor and the next one rich.
    const bool stood_still = line.find("expected samples in a second") != std::string::npos;
    INFO(line);
    CHECK((stood_still || line == "IMU: normal again"));
  }
  const Judged judged = judge(sink, far, begin);
  report(name, seconds, judged, sink, far, poses);
  check(seconds, judged, sink, far);
}

Stamp atOnce(Stamp /*at*/) { return monotonicNow(); }

double realSeconds() { return longOr(600.0, 20.0); }

TEST_CASE("IMU in and poses out over one serial port of 92 kB/s", "[autopilot][long]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  const Stamp begin = monotonicNow();
  FarAutopilot far(begin, {});
  double room = 0;
  Stamp pumped = begin;
  FarAutopilot::Bytes out;
  fly("one serial port", terminal.path(), realSeconds(), far, begin, [&](Stamp now) {
    // What the line takes off the port in this time.
    constexpr double kBytesPerSecond = 92'000;
    constexpr double kMost = 512;
    room = std::min(room + (now - pumped).seconds() * kBytesPerSecond, kMost);
    pumped = now;
    std::array<std::uint8_t, 512> bytes;
    std::size_t count = 0;
    REQUIRE(terminal.receive(std::span(bytes).first(static_cast<std::size_t>(room)), count).ok());
    room -= static_cast<double>(count);
    far.receive(now, std::span(bytes).first(count));
    far.step(now, atOnce, [&](const FarAutopilot::Bytes& more, Stamp /*at*/) {
      out.insert(out.end(), more.begin(), more.end());
    });
    std::size_t taken = 0;
    if (!out.empty()) REQUIRE(terminal.send(out, taken).ok());
    out.erase(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(taken));
  });
}

/// PX4's simulator: a socket on one port that sends to another.
class SimulatorSocket {
 public:
  SimulatorSocket(std::uint16_t own, std::uint16_t to)
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    sockaddr_in here = address(own);
    REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&here), sizeof here) == 0);
    to_ = address(to);
  }
  ~SimulatorSocket() { ::close(socket_); }
  SimulatorSocket(const SimulatorSocket&) = delete;
  SimulatorSocket& operator=(const SimulatorSocket&) = delete;
  void send(const FarAutopilot::Bytes& bytes) const {
    if (bytes.empty()) return;
    static_cast<void>(::sendto(socket_, bytes.data(), bytes.size(), 0,
                               reinterpret_cast<const sockaddr*>(&to_), sizeof to_));
  }
  FarAutopilot::Bytes receive() const {
    FarAutopilot::Bytes bytes(2048);
    const ssize_t count = ::recv(socket_, bytes.data(), bytes.size(), 0);
    bytes.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
    return bytes;
  }

 private:
  static sockaddr_in address(std::uint16_t port) {
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    ::inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    return address;
  }
  int socket_;
  sockaddr_in to_ = {};
};

TEST_CASE("IMU in and poses out over UDP on the ports of PX4's simulator", "[autopilot][long]") {
  const SimulatorSocket simulator(14580, 14540);
  const Stamp begin = monotonicNow();
  FarAutopilot::Options options;
  options.bytes_per_second = 4e6;
  FarAutopilot far(begin, options);
  fly("one UDP link", "udp:127.0.0.1:14580@14540", realSeconds(), far, begin, [&](Stamp now) {
    for (FarAutopilot::Bytes bytes = simulator.receive(); !bytes.empty(); bytes = simulator.receive()) {
      far.receive(now, bytes);
    }
    far.step(now, atOnce, [&](const FarAutopilot::Bytes& bytes, Stamp /*at*/) { simulator.send(bytes); });
  });
}

constexpr Duration kTick = Duration::fromMilliseconds(1);

/// The link and its far end in simulated time: each receive() of the IMU's thread is five ticks.
class SimulatedLink : public ImuLink {
 public:
  SimulatedLink(Stamp begin, std::int64_t ticks, FarAutopilot::Options options, std::atomic<bool>& stop)
      : far(begin, options),
        now_(begin),
        last_(begin + Duration{ticks * kTick.ns}),
        stop_(stop),
        fd_(eventfd(1, EFD_CLOEXEC)) {}
  ~SimulatedLink() override { ::close(fd_); }
  FarAutopilot far;
  std::optional<NavState> state;
  std::function<void(FarAutopilot&, Stamp)> at_tick = [](FarAutopilot&, Stamp) {};
  std::vector<std::string> remarks;
  [[nodiscard]] const AutopilotDialogue& dialogue() const { return dialogue_; }

  DeviceFault open() override { return {}; }
  [[nodiscard]] bool isOpen() const override { return true; }
  [[nodiscard]] int fd() const override { return fd_; }
  DeviceFault receive(Stamp /*real*/) override {
    for (int i = 0; i < 5; ++i) tick();
    if (now_ >= last_) stop_.store(true);
    return {};
  }
  DeviceFault send() override {
    std::array<std::uint8_t, AutopilotDialogue::kMostBytes> said;
    down(std::span(said).first(dialogue_.step(decoder_, now_, said)));
    for (DeviceFault remark; dialogue_.stream().nextRemark(remark);)
      remarks.push_back(describe(remark, "IMU"));
    return {};
  }
  bool next(ImuReading& reading) override { return decoder_.next(reading); }
  [[nodiscard]] std::uint64_t received() const override { return decoder_.counters().bytes; }
  [[nodiscard]] std::optional<Stamp> toHost(Stamp device) const override { return dialogue_.toHost(device); }
  [[nodiscard]] nlohmann::ordered_json counters() const override { return {}; }

 private:
  void down(std::span<const std::uint8_t> bytes) { wire_.insert(wire_.end(), bytes.begin(), bytes.end()); }
  void tick() {
    std::array<std::uint8_t, AutopilotLink::kMostBytes> out;
    down(std::span(out).first(outlet_.step(now_, state ? &*state : nullptr, Eigen::Vector3d::Zero(), out)));
    const std::size_t count = std::min(wire_.size(), std::size_t{92});
    far.receive(now_, FarAutopilot::Bytes(wire_.begin(), wire_.begin() + static_cast<std::ptrdiff_t>(count)));
    wire_.erase(wire_.begin(), wire_.begin() + static_cast<std::ptrdiff_t>(count));
    now_ = now_ + kTick;
    at_tick(far, now_);
    far.step(
        now_, [](Stamp at) { return at; },
        [this](const FarAutopilot::Bytes& up, Stamp at) { REQUIRE(decoder_.feed(up, at, {}) == up.size()); });
  }

  Stamp now_, last_;
  std::atomic<bool>& stop_;
  int fd_;
  ImuDecoder decoder_{ImuProtocol::kMavlink};
  AutopilotDialogue dialogue_{kRate};
  AutopilotLink outlet_{AutopilotLinkSettings{}};
  std::deque<std::uint8_t> wire_;
};

struct Simulated {
  std::atomic<bool> stop{false};
  Stamp begin{90'000'000'000};
  SimulatedLink* link;
  std::unique_ptr<ImuThread> imu;
  StateSink sink;

  explicit Simulated(double seconds, FarAutopilot::Options options = {})
      : sink([this](const NavState& state) { link->state = state; }, options.has_highres ? 1 : 9.80665e-3) {
    auto owned = std::make_unique<SimulatedLink>(begin, static_cast<std::int64_t>(seconds / kTick.seconds()),
                                                 options, stop);
    link = owned.get();
    imu = std::make_unique<ImuThread>("IMU", std::move(owned), ImuCorrection{}, Duration{});
  }
  void run() {
    RunControl control;
    control.stop = &stop;
    imu->run(sink, {}, control);
  }
};

TEST_CASE("Only the sender of the samples is asked for its clock and answers for it", "[autopilot]") {
  constexpr Duration kOther = Duration::fromMilliseconds(5);  ///< of another system's clock
  ImuDecoder decoder(ImuProtocol::kMavlink);
  AutopilotDialogue dialogue(0);
  MavlinkSender autopilot{.system = 1, .component = 1, .sequence = 0};
  MavlinkSender other{.system = 2, .component = 1, .sequence = 0};
  MavlinkSender camera{.system = 1, .component = 100, .sequence = 0};
  std::array<std::uint8_t, kLongestMavlinkFrame> frame;
  const auto feed = [&](MavlinkSender& sender, const auto& message, Stamp at) {
    const auto bytes = std::span(frame).first(mavlink::write(sender, message, frame));
    REQUIRE(decoder.feed(bytes, at, {}) == bytes.size());
    for (ImuReading reading; decoder.next(reading);) continue;
  };
  MavlinkParser parser;
  Stamp now{100'000'000'000};
  for (int i = 0; i < 50; ++i, now = now + Duration::fromMilliseconds(100)) {
    mavlink::HighresImu imu;
    imu.time_usec = static_cast<std::uint64_t>(now.ns / 1000);
    imu.fields_updated = mavlink::HighresImu::kAccelUpdated | mavlink::HighresImu::kGyroUpdated;
    feed(autopilot, imu, now);
    std::array<std::uint8_t, AutopilotDialogue::kMostBytes> said;
    const std::size_t length = dialogue.step(decoder, now, said);
    REQUIRE(parser.feed(std::span(said).first(length), now, {}) == length);
    for (MavlinkFrame heard; parser.next(heard);) {
      mavlink::Timesync request;
      REQUIRE((mavlink::read(heard, request) && request.tc1 == 0));
      CHECK(request.target_system == autopilot.system);
      CHECK(request.target_component == autopilot.component);
      const Stamp at = now + Duration::fromMilliseconds(1);
      feed(other, mavlink::Timesync{(at + kOther).ns, request.ts1, 0, 0}, at);
      feed(camera, mavlink::Timesync{(at + kOther).ns, request.ts1, 0, 0}, at);
      feed(autopilot, mavlink::Timesync{at.ns, request.ts1, 0, 0}, at + Duration::fromMilliseconds(1));
    }
  }
  const std::optional<Stamp> host = dialogue.toHost(now);
  REQUIRE(host);
  CHECK(std::abs((*host - now).seconds()) < 1e-4);
}

TEST_CASE("An hour of both ways on one link in simulated time", "[autopilot]") {
  constexpr double kSeconds = 3600;
  Simulated flight(kSeconds);
  flight.run();
  const Judged judged = judge(flight.sink, flight.link->far, flight.begin);
  report("an hour", kSeconds, judged, flight.sink, flight.link->far, flight.link->far.pose_times.size());
  check(kSeconds, judged, flight.sink, flight.link->far);
  CHECK(flight.link->far.requests == 1);
}

TEST_CASE("An autopilot that forgets the rate is asked again within two seconds", "[autopilot]") {
  constexpr double kSeconds = 60;
  Simulated flight(kSeconds);
  std::uint64_t before = 0;
  Stamp again;
  flight.link->at_tick = [&](FarAutopilot& far, Stamp now) {
    if (now - flight.begin == Duration::fromMilliseconds(30'000)) {
      far.forget();
      before = far.requests;
    }
    if (before > 0 && again == Stamp{} && far.requests > before) again = now;
  };
  flight.run();
  CHECK(flight.link->far.requests == 2);
  CHECK((again - flight.begin).seconds() < 32);
  CHECK(judge(flight.sink, flight.link->far, flight.begin).lost == 0);
  CHECK(static_cast<double>(flight.sink.samples.size()) > kRate * (kSeconds - 4));
}

TEST_CASE("An autopilot without HIGHRES_IMU gives RAW_IMU, and that is said", "[autopilot]") {
  FarAutopilot::Options options;
  options.has_highres = false;
  Simulated flight(30, options);
  flight.run();
  CHECK(flight.link->far.commands == std::vector<std::uint32_t>{105, 27});
  CHECK(flight.link->dialogue().stream().message() == 27);
  REQUIRE(flight.link->remarks.size() == 1);
  CHECK_THAT(flight.link->remarks[0], Catch::Contains("no HIGHRES_IMU received, requesting RAW_IMU"));
  // It was refused: a second and not three.
  CHECK(static_cast<double>(flight.sink.samples.size()) > kRate * 27);
  const Judged judged = judge(flight.sink, flight.link->far, flight.begin);
  report("RAW_IMU", 30, judged, flight.sink, flight.link->far, flight.link->far.pose_times.size());
  CHECK(judged.lost == 0);
  CHECK(percentile(judged.errors, 0.99) < kStampLimit);
}

}  // namespace
}  // namespace swiftlet::test
