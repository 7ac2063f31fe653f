// Sensors that are set to the calibration's rate when their port is opened: scripted ones on
// pseudo-terminals, which know their protocol's commands and send as they were told.

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/serial/imu_encoder.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/inputs/devices/port_imu_link.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"

namespace swiftlet::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// What a sensor does with a command: `heard` is all since the last one that it knew.
struct Script {
  std::string command;  ///< bytes that the command holds
  Bytes reply;
  double rate = -1;  ///< from then on [Hz]; below 0: as before
};

std::string text(std::initializer_list<int> bytes) {
  std::string text;
  for (const int byte : bytes) text += static_cast<char>(byte);
  return text;
}
Bytes bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

class ScriptedSensor {
 public:
  ScriptedSensor(ImuProtocol protocol, double rate, std::vector<Script> scripts)
      : encoder_(protocol), rate_(rate), scripts_(std::move(scripts)) {
    REQUIRE(terminal_.open().ok());
    thread_ = std::thread([this] { run(); });
  }
  ~ScriptedSensor() {
    stop_.store(true);
    thread_.join();
  }
  [[nodiscard]] const std::string& path() const { return terminal_.path(); }
  [[nodiscard]] int commands() const { return commands_; }
  [[nodiscard]] bool wasAsked() const { return asked_; }
  /// Its power fails: it sends at its factory rate again, while its port stays.
  void fallBackTo(double rate) { factory_ = rate; }

 private:
  void run() {
    Stamp next = monotonicNow();
    std::string heard;
    while (!stop_.load()) {
      if (const double factory = factory_.exchange(-1); factory >= 0) rate_ = factory;
      std::array<std::uint8_t, 256> bytes;
      std::size_t count = 0, taken = 0;
      static_cast<void>(terminal_.receive(bytes, count));
      heard.append(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      if (count > 0) asked_ = true;
      for (const Script& script : scripts_) {
        if (heard.find(script.command) == std::string::npos) continue;
        heard.clear();
        ++commands_;
        static_cast<void>(terminal_.send(script.reply, taken));
        if (script.rate >= 0) rate_ = script.rate;
        break;
      }
      for (; rate_ > 0 && next <= monotonicNow(); next = next + Duration::fromSeconds(1 / rate_)) {
        ImuReading reading;
        reading.device = next;
        reading.gyro = reading.accel = Eigen::Vector3d(0.5, 0.25, 0.125);
        std::array<std::uint8_t, ImuEncoder::kLongestFrame> frame;
        static_cast<void>(terminal_.send(std::span(frame).first(encoder_.encode(reading, frame)), taken));
      }
      if (rate_ <= 0) next = monotonicNow();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  PseudoTerminal terminal_;
  ImuEncoder encoder_;
  double rate_;
  std::vector<Script> scripts_;
  std::atomic<bool> stop_{false}, asked_{false};
  std::atomic<int> commands_{0};
  std::atomic<double> factory_{-1};
  std::thread thread_;
};

struct Opened {
  std::vector<std::string> warnings;
  std::string text;
};

Opened open(const ScriptedSensor& sensor, const char* protocol, double rate) {
  ImuLinkGroup settings;
  settings.device = sensor.path();
  settings.protocol = protocol;
  PortImuLink link(settings, rate);
  REQUIRE(link.open().ok());
  Opened opened;
  for (DeviceFault warning; link.nextRemark(warning);) opened.warnings.push_back(describe(warning, "IMU"));
  opened.text = link.stream();
  // Readings come as if nothing had been asked.
  std::size_t readings = 0;
  for (int i = 0; i < 2000 && readings < 5; ++i) {
    REQUIRE(link.receive(monotonicNow()).ok());
    for (ImuReading reading; link.next(reading);) ++readings;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(readings >= 5);
  return opened;
}

TEST_CASE("a sensor that sends at the rate is left alone") {
  for (const auto& [protocol, name] : {std::pair{ImuProtocol::kVectorNav, "vectornav"},
                                       {ImuProtocol::kXsens, "xsens"},
                                       {ImuProtocol::kMip, "mip"},
                                       {ImuProtocol::kBridge, "bridge"}}) {
    const ScriptedSensor sensor(protocol, 200, {});
    const Opened opened = open(sensor, name, 200);
    CHECK(opened.warnings.empty());
    CHECK_FALSE(sensor.wasAsked());
  }
}

TEST_CASE("sensors that send at another rate are set") {
  {
    const ScriptedSensor sensor(ImuProtocol::kVectorNav, 40,
                                {{"$VNWRG,75,3,4,01,0201*71", bytesOf("$VNWRG,75,3,4,01,0201*71\r\n"), 200}});
    const Opened opened = open(sensor, "vectornav", 200);
    CHECK(opened.warnings.empty());
    CHECK(opened.text == "sent at 40 Hz, set to 200.0 Hz");
    CHECK(sensor.commands() == 1);
  }
  {
    const ScriptedSensor sensor(
        ImuProtocol::kXsens, 100,
        {{text({0xFA, 0xFF, 0x30, 0x00, 0xD1}), {0xFA, 0xFF, 0x31, 0x00, 0xD0}, 0},
         {text({0xFA, 0xFF, 0xC0, 0x10}), {0xFA, 0xFF, 0xC1, 0x10, 0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF,
                                           0xFF, 0x40, 0x20, 0x00, 0xC8, 0x80, 0x20, 0x00, 0xC8, 0x04}},
         {text({0xFA, 0xFF, 0x10, 0x00, 0xF1}), {0xFA, 0xFF, 0x11, 0x00, 0xF0}, 200}});
    const Opened opened = open(sensor, "xsens", 200);
    CHECK(opened.warnings.empty());
    CHECK(opened.text == "sent at 100 Hz, set to 200.0 Hz");
    CHECK(sensor.commands() == 3);
  }
  {
    const auto mip = [](std::uint8_t command) { return Bytes{0x04, 0xF1, command, 0x00}; };
    const ScriptedSensor sensor(ImuProtocol::kMip, 0,
                                {{text({0x75, 0x65, 0x01, 0x02, 0x02, 0x02}), mip(0x02), 0},
                                 {text({0x0C, 0x03, 0x03, 0x0E, 0x80}),
                                  {0x04, 0xF1, 0x0E, 0x00, 0x05, 0x8E, 0x80, 0x01, 0xF4}},  // 500 Hz
                                 {text({0x0E, 0x0F, 0x01, 0x80, 0x03, 0xD5, 0x00, 0x03}), mip(0x0F)},
                                 {text({0x05, 0x11, 0x01, 0x80, 0x01}), mip(0x11)},
                                 {text({0x75, 0x65, 0x01, 0x02, 0x02, 0x06}), mip(0x06), 500.0 / 3}});
    const Opened opened = open(sensor, "mip", 200);
    REQUIRE(opened.warnings.size() == 1);  // 500 / 3 is not 200
    CHECK_THAT(opened.warnings[0], Catch::Contains("200 Hz requested, 166.7 Hz set"));
    CHECK(sensor.commands() == 5);
  }
}

TEST_CASE("a sensor that loses power in flight is set again") {
  // Found at the rate, or set to it, when the flight began.
  const double at_first = GENERATE(200.0, 40.0);
  const double after = GENERATE(40.0, 0.0);
  ScriptedSensor sensor(ImuProtocol::kVectorNav, at_first,
                        {{"$VNWRG,75,3,4,01,0201*71", bytesOf("$VNWRG,75,3,4,01,0201*71\r\n"), 200}});
  ImuLinkGroup settings;
  settings.device = sensor.path();
  settings.protocol = "vectornav";
  constexpr double kRate = 200;
  ImuThread imu("IMU", std::make_unique<PortImuLink>(settings, kRate), ImuCorrection{}, Duration{}, kRate);
  REQUIRE(imu.open().ok());
  const int commands = sensor.commands();
  KeepingSink sink;
  RunningImu running(imu, sink);
  REQUIRE(soon([&] { return sink.count() > 300; }));
  CHECK(sensor.commands() == commands);
  sensor.fallBackTo(after);
  CHECK(soon([&] { return sensor.commands() == commands + 1; }));
  const std::size_t before = sink.count();
  CHECK(soon([&] { return sink.count() > before + 200; }));
  CHECK(soon([&] { return running.linesWith(after > 0 ? "normal again" : "works again") == 1; }));
  running.end();
  CHECK(sensor.commands() == commands + 1);
}

TEST_CASE("a refusal and silence are warnings, and the sensor goes on") {
  {
    const ScriptedSensor sensor(ImuProtocol::kVectorNav, 40, {{"$VNWRG", bytesOf("$VNERR,03*72\r\n")}});
    const Opened opened = open(sensor, "vectornav", 200);
    REQUIRE(opened.warnings.size() == 1);
    CHECK_THAT(opened.warnings[0], Catch::Contains("200 Hz requested") && Catch::Contains("a refusal"));
  }
  {
    // Its output is refused when it has stopped measuring.
    const ScriptedSensor sensor(
        ImuProtocol::kXsens, 100,
        {{text({0xFA, 0xFF, 0x30, 0x00, 0xD1}), {0xFA, 0xFF, 0x31, 0x00, 0xD0}, 0},
         {text({0xFA, 0xFF, 0xC0, 0x10}), {0xFA, 0xFF, 0x42, 0x01, 0x03, 0xBB}},
         {text({0xFA, 0xFF, 0x10, 0x00, 0xF1}), {0xFA, 0xFF, 0x11, 0x00, 0xF0}, 100}});
    const Opened opened = open(sensor, "xsens", 200);
    REQUIRE(opened.warnings.size() == 1);
    CHECK_THAT(opened.warnings[0], Catch::Contains("a refusal"));
  }
  {
    const ScriptedSensor sensor(ImuProtocol::kMip, 100, {});
    const Opened opened = open(sensor, "mip", 200);
    REQUIRE(opened.warnings.size() == 1);
    CHECK_THAT(opened.warnings[0], Catch::Contains("\"idle\"") && Catch::Contains("no reply"));
    CHECK(opened.text == "sends at 100 Hz and could not be set to 200 Hz");
  }
}

}  // namespace
}  // namespace swiftlet::test
