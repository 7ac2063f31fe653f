// What LiveInput refuses names its setting; devices that are missing are all told.

#include <sched.h>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <map>
#include <thread>

#include "drivers/simulated/rig_presets.hpp"
#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/inputs/devices/sensor_threads.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

Calibration stereo() {
  Calibration calibration;
  calibration.rig = makeRig(RigKind::kEuroc).rig;
  return calibration;
}

Calibration mono() {
  Calibration calibration = stereo();
  calibration.rig.camera_count = 1;
  return calibration;
}

Settings vehicle() {
  Settings settings;
  settings.imu_link.device = "/dev/no_such_imu";
  settings.cameras.device0 = "/dev/no_such_camera0";
  settings.cameras.device1 = "/dev/no_such_camera1";
  return settings;
}

/// "key: remedy", or empty: taken.
std::string refusal(const Settings& settings, const Calibration& calibration) {
  return test::messageOf([&] { const LiveInput input(settings, calibration); });
}

TEST_CASE("a trigger is known to the flight whichever device gives its edges") {
  Settings settings = vehicle();
  CHECK_FALSE(LiveInput(settings, stereo()).hasTrigger());
  settings.trigger.chip = "imu";
  LiveInput by_imu(settings, stereo());
  CHECK(by_imu.hasTrigger());
  FlightFacts facts;
  by_imu.look(facts);
  CHECK(facts.trigger.messages == 0);
  settings.trigger.chip = "/dev/no_such_chip";
  settings.trigger.line = "0";
  CHECK(LiveInput(settings, stereo()).hasTrigger());
}

TEST_CASE("each refusal names its setting and what to do") {
  CHECK(refusal(vehicle(), stereo()).empty());

  Settings settings = vehicle();
  settings.imu_link.device.clear();
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("imu_link.device") && Catch::Contains("swiftlet doctor"));

  settings = vehicle();
  settings.cameras.device0.clear();
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.device0") && Catch::Contains("swiftlet doctor"));

  settings = vehicle();
  settings.cameras.device1.clear();
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.device1") && Catch::Contains("side_by_side"));
  CHECK(refusal(settings, mono()).empty());
  settings.cameras.side_by_side = true;
  CHECK(refusal(settings, stereo()).empty());
  CHECK_THAT(refusal(settings, mono()), Catch::Contains("vehicle.calibration"));

  CHECK_THAT(refusal(vehicle(), mono()),
             Catch::Contains("vehicle.calibration") && Catch::Contains("device1"));

  settings = vehicle();
  settings.cameras.side_by_side = true;
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.device1") && Catch::Contains("holds both"));

  settings = vehicle();
  settings.cameras.device1 = settings.cameras.device0;
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("cameras.device1") && Catch::Contains("same"));

  settings = vehicle();
  settings.cameras.device1.clear();
  settings.cameras.side_by_side = true;
  Calibration odd = stereo();
  odd.rig.camera[1] = makeRig(RigKind::kForward).rig.camera[1];
  CHECK_THAT(refusal(settings, odd), Catch::Contains("cameras.device0") && Catch::Contains("size"));

  settings = vehicle();
  settings.imu_link.protocol = "dronecan";
  CHECK(refusal(settings, stereo()).empty());
  settings.trigger.chip = "imu";
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("trigger.chip") && Catch::Contains("dronecan"));
  settings.imu_link.protocol = "xsens";
  CHECK(refusal(settings, stereo()).empty());
  settings.trigger.line = "2";
  CHECK(refusal(settings, stereo()).empty());
  for (const char* line : {"TriggerIn2", "-1", "256", "2 "}) {
    settings.trigger.line = line;
    CHECK_THAT(refusal(settings, stereo()), Catch::Contains("trigger.line") && Catch::Contains(line));
  }
}

TEST_CASE("IMU and autopilot share a link where both settings name one port") {
  const auto outboxOf = [](const Settings& settings) {
    return LiveInput(settings, stereo()).outbox() != nullptr;
  };
  Settings settings = vehicle();
  CHECK_FALSE(outboxOf(settings));
  settings.imu_link.protocol = "mavlink";
  settings.autopilot.device = "/dev/another_port";
  CHECK_FALSE(outboxOf(settings));
  for (const char* device : {"/dev/no_such_imu", "udp:127.0.0.1:14580@14540"}) {
    settings.imu_link.device = settings.autopilot.device = device;
    CHECK(outboxOf(settings));
  }

  settings.imu_link.device = settings.autopilot.device = "/dev/no_such_imu";
  settings.autopilot.baud = 460800;
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("autopilot.baud") && Catch::Contains("imu_link.baud is 921600"));
  settings.autopilot.baud = settings.imu_link.baud;
  settings.imu_link.protocol = "vectornav";
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("autopilot.device") && Catch::Contains("mavlink"));

  settings = vehicle();
  settings.imu_link.device = "udp:127.0.0.1:14580@14540";
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("imu_link.device") && Catch::Contains("mavlink"));
  settings.imu_link.protocol = "mavlink";
  CHECK(refusal(settings, stereo()).empty());
  settings.imu_link.device = "udp:127.0.0.1:many";
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("imu_link.device") && Catch::Contains("the port must be"));
}

TEST_CASE("a pixel format that is not taken is refused, whatever is connected") {
  Settings settings = vehicle();
  for (const char* format : {"MJPEG", "H264", "grey"}) {
    settings.cameras.format = format;
    CHECK_THAT(refusal(settings, stereo()), Catch::Contains("cameras.format") && Catch::Contains(format));
  }
  settings.cameras.format = "MJPG";
  CHECK(refusal(settings, stereo()).empty());
}

TEST_CASE("a pipeline stands in for a video node, and never beside one") {
  Settings settings = vehicle();
  settings.cameras.pipeline0 = "videotestsrc";
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("cameras.pipeline0") &&
                                              Catch::Contains("cameras.device0") &&
                                              Catch::Contains("Remove one of them"));
  settings.cameras.device0.clear();
  CHECK(refusal(settings, stereo()).empty());
  settings.cameras.format = "GREY";  // of camera 1's node
  CHECK(refusal(settings, stereo()).empty());
  settings.cameras.pipeline1 = "videotestsrc";
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("cameras.pipeline1"));
  settings.cameras.device1.clear();
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.format") && Catch::Contains("video/x-raw"));
  settings.cameras.format = "any";
  CHECK(refusal(settings, stereo()).empty());
  settings.cameras.gain = 3;
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.gain") && Catch::Contains("only to video nodes"));
  settings.cameras.gain = -1;
  CHECK_THAT(refusal(settings, mono()),
             Catch::Contains("vehicle.calibration") && Catch::Contains("pipeline1"));
  settings.cameras.side_by_side = true;
  CHECK_THAT(refusal(settings, stereo()),
             Catch::Contains("cameras.pipeline1") && Catch::Contains("holds both"));
  settings.cameras.pipeline1.clear();
  CHECK(refusal(settings, stereo()).empty());
  settings.cameras.side_by_side = false;
  CHECK_THAT(refusal(settings, stereo()), Catch::Contains("cameras.device1") && Catch::Contains("pipeline"));
  CHECK(refusal(settings, mono()).empty());
}

TEST_CASE("pipelines run below the flight path, or say that this build has none", "[glib]") {
  Settings settings = vehicle();
  settings.cameras.device0.clear();
  settings.cameras.device1.clear();
  settings.cameras.pipeline0 = "videotestsrc is-live=true";
  settings.cameras.pipeline1 = "videotestsrc is-live=true pattern=ball ! video/x-raw,format=NV12";
  LiveInput input(settings, stereo());
  const LiveInput::Opened opened = input.open();
#ifdef SWIFTLET_TEST_GSTREAMER
  REQUIRE(opened.faults.size() == 1);
  CHECK_THAT(opened.faults[0], Catch::StartsWith("IMU"));
  CHECK(opened.warnings.empty());
  // Where the thread of an image stands.
  struct PolicySink : SensorSink {
    void takeImu(const ImuSample&, Stamp, const HostTimes&) override {}
    void takeScene(const SceneImages&) override {}
    void takeImage(const CameraFrame& image, const HostTimes&) override {
      policy[image.camera] = sched_getscheduler(0);
    }
    std::array<std::atomic<int>, 2> policy = {-1, -1};
  } sink;
  const RunControl control;
  const auto threads = input.threads(sink, control);
  REQUIRE(threads.size() == 3);
  CHECK(threads[0].level == SensorInput::Level::kSensor);
  CHECK(threads[1].level == SensorInput::Level::kLibrary);
  CHECK(threads[2].level == SensorInput::Level::kLibrary);
  SensorThreads running(input, sink, settings.realtime);
  for (int i = 0; i < 500 && (sink.policy[0] < 0 || sink.policy[1] < 0); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  running.join();
  CHECK(sink.policy[0] == SCHED_OTHER);
  CHECK(sink.policy[1] == SCHED_OTHER);
  const nlohmann::ordered_json counters = input.counters();
  CHECK(counters["camera0"]["frames"] > 0);
#else
  REQUIRE(opened.faults.size() == 3);
  for (std::size_t i = 1; i < 3; ++i) {
    CHECK_THAT(opened.faults[i], Catch::Contains("-DSWIFTLET_WITH_GSTREAMER=ON"));
  }
#endif
}

TEST_CASE("all devices that are missing are told at once, each by name and with what to do") {
  Settings settings = vehicle();
  settings.trigger.chip = "/dev/no_such_chip";
  LiveInput input(settings, stereo());
  const LiveInput::Opened opened = input.open();
  REQUIRE(opened.faults.size() == 4);
  for (const auto& [line, device] : {std::pair{0, "IMU (/dev/no_such_imu, bridge)"},
                                     {1, "camera 0 (/dev/no_such_camera0)"},
                                     {2, "camera 1 (/dev/no_such_camera1)"},
                                     {3, "trigger (/dev/no_such_chip, line 0)"}}) {
    const std::string& text = opened.faults[static_cast<std::size_t>(line)];
    CHECK_THAT(text, Catch::StartsWith(device));
    CHECK_THAT(text, Catch::Contains("connect it, or correct its name in the vehicle settings"));
  }
}

TEST_CASE("threads look for devices that are gone, end when told, and say once that they are not there") {
  Settings settings = vehicle();
  settings.trigger.chip = "/dev/no_such_chip";
  settings.realtime.enabled = false;
  LiveInput input(settings, stereo());
  struct NoSink : SensorSink {
    void takeImu(const ImuSample&, Stamp, const HostTimes&) override { ++taken; }
    void takeScene(const SceneImages&) override { ++taken; }
    void takeImage(const CameraFrame&, const HostTimes&) override { ++taken; }
    std::atomic<int> taken{0};
  } sink;
  {
    SensorThreads threads(input, sink, settings.realtime);
    CHECK(threads.warnings().empty());
    std::this_thread::sleep_for(std::chrono::milliseconds(450));  // three looks
  }
  std::map<std::string, int> lines;
  input.drainEvents([&](Stamp /*stamp*/, const std::string& line) { ++lines[line]; });
  CHECK(lines.size() == 4);
  for (const auto& [line, count] : lines) {
    INFO(line);
    CHECK(count == 1);
    CHECK_THAT(line, Catch::Contains("not there"));
  }
  CHECK(sink.taken == 0);
  CHECK(input.taken() == 0);
  const nlohmann::ordered_json counters = input.counters();
  CHECK(counters["faults"].size() == 4);
  CHECK(counters["imu"]["samples"] == 0);
}

}  // namespace
}  // namespace swiftlet
