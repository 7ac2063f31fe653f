// The kernel's virtual CAN bus: streams without loss, error frames, down and up; inside the sandbox.
#include <catch2/catch.hpp>

#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "drivers/can/raw_imu.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "tests/drivers/can/flight.hpp"
#include "tests/drivers/recorded/recording_allocations.hpp"
#include "tests/support/sandbox.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kNode = 42;
constexpr std::uint32_t kErrorFlag = 0x20000000;

CanBusSettings settings() {
  CanBusSettings s;
  s.setInterface(sandbox::device("SANDBOX_CAN").c_str());
  return s;
}

void sleepUntil(Stamp stamp) {
  const timespec until = {stamp.ns / 1'000'000'000, stamp.ns % 1'000'000'000};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

void setUp(bool up) {
  const std::string name = sandbox::device("SANDBOX_CAN");
  REQUIRE(std::system(("ip link set " + name + (up ? " up" : " down")).c_str()) == 0);
}

/// An error frame as a controller's driver would report it; the virtual bus carries it as it is.
CanFrame errorFrame(std::uint32_t errors, std::uint8_t controller = 0) {
  CanFrame frame;
  frame.id = errors | kErrorFlag;
  frame.extended = false;
  frame.size = 8;
  frame.data[1] = controller;
  return frame;
}

DeviceFault nextOf(CanBus& bus, std::optional<CanFrame>& frame, int ms = 200) {
  pollfd waiting = {bus.fd(), POLLIN, 0};
  ::poll(&waiting, 1, ms);
  return bus.next(frame);
}

void stream(bool fd, std::int64_t count) {
  constexpr std::int64_t kPeriodNs = 2'500'000;
  constexpr std::int64_t kRoundingNs = 100;  // of the kernel's clocks
  CanBus sender;
  CanBus receiver;
  REQUIRE(sender.open(settings()).ok());
  CanBusSettings listening = settings();
  RawImuDecoder::addFilters(listening);
  listening.fd = fd;
  REQUIRE(receiver.open(listening).ok());
  RawImuDecoder decoder;
  std::vector<std::int64_t> steps;
  std::int64_t expected = 0;
  Stamp newest;
  std::int64_t late_ns = 0;
  const Stamp begin = monotonicNow();
  for (std::int64_t i = 0; i < count; ++i) {
    const Stamp due = begin + Duration{(i + 1) * kPeriodNs};
    sleepUntil(due);
    const DroneCanFrames frames = canflight::frames(static_cast<std::uint64_t>(i), kNode, fd);
    for (std::size_t k = 0; k < frames.count; ++k) REQUIRE(sender.send(frames.frames[k]).ok());
    // Another program's traffic, which the filter keeps out.
    CanFrame other;
    other.id = 0x10015501;
    other.size = 8;
    REQUIRE(sender.send(other).ok());
    // Read in bursts: the socket holds what comes in between.
    if (i % 7 != 6 && i + 1 != count) continue;
    std::optional<CanFrame> frame;
    for (;;) {
      REQUIRE(receiver.next(frame).ok());
      if (!frame) break;
      ImuReading reading;
      if (!decoder.take(*frame, reading)) continue;
      REQUIRE(canflight::numberOf(reading) == expected);
      REQUIRE(reading.counter == static_cast<std::uint64_t>(expected));
      REQUIRE(reading.arrival <= monotonicNow());
      // By the kernel's stamp, not by when it was read.
      const Duration late = reading.arrival - (begin + Duration{(expected + 1) * kPeriodNs});
      REQUIRE(late.ns > -receiver.stampError().ns - kRoundingNs);
      late_ns = std::max(late_ns, late.ns);
      if (expected > 0) steps.push_back((reading.arrival - newest).ns);
      newest = reading.arrival;
      ++expected;
    }
  }
  std::sort(steps.begin(), steps.end());
  std::printf(
      "%s: %lld of %lld readings, steps %.3f to %.3f ms, at most %.3f ms after their time, stamps to %.3f "
      "ms\n",
      fd ? "FD" : "classic", static_cast<long long>(expected), static_cast<long long>(count),
      1e-6 * static_cast<double>(steps.front()), 1e-6 * static_cast<double>(steps.back()),
      1e-6 * static_cast<double>(late_ns), 1e-6 * static_cast<double>(receiver.stampError().ns));
  CHECK(expected == count);
  CHECK(decoder.transfers().lost == 0);
  CHECK(receiver.counters().lost_in_socket == 0);
  CHECK(receiver.counters().without_stamp == 0);
  CHECK(receiver.counters().frames == static_cast<std::uint64_t>(count * (fd ? 1 : 7)));
  CHECK(receiver.counters().fd_frames == (fd ? receiver.counters().frames : 0));
}

TEST_CASE("RawIMU at 400 Hz for 10 s arrives without loss, in classic and in FD frames", "[bus]") {
  stream(false, 4000);
  stream(true, 4000);
}

TEST_CASE("RawIMU at 400 Hz by this machine's clock arrives without loss", "[.real time]") {
  stream(false, 4000);
  stream(true, 4000);
}

TEST_CASE("A frame arrives as it was sent, with the stamp of its receipt", "[bus]") {
  CanBus sender;
  CanBus receiver;
  REQUIRE(sender.open(settings()).ok());
  REQUIRE(receiver.open(settings()).ok());
  CHECK(receiver.warning().ok());
  CanFrame sent;
  sent.id = 0x123;
  sent.extended = false;
  sent.fd = true;
  sent.fast_data = true;
  sent.size = 64;
  for (std::size_t i = 0; i < 64; ++i) sent.data[i] = static_cast<std::uint8_t>(3 * i);
  const Stamp before = monotonicNow();
  REQUIRE(sender.send(sent).ok());
  std::optional<CanFrame> frame;
  REQUIRE(nextOf(receiver, frame).ok());
  REQUIRE(frame);
  CHECK(frame->id == 0x123);
  CHECK(!frame->extended);
  CHECK(frame->fd);
  CHECK(frame->fast_data);
  CHECK(frame->size == 64);
  CHECK(frame->data == sent.data);
  CHECK(frame->arrival.ns >= before.ns - 1000);
  CHECK(frame->arrival <= monotonicNow());
}

TEST_CASE("A step of the wall clock does not move arrivals", "[bus]") {
  CanBus sender;
  CanBus receiver;
  REQUIRE(sender.open(settings()).ok());
  REQUIRE(receiver.open(settings()).ok());
  CanFrame frame;
  frame.id = 1;
  frame.size = 1;
  for (const std::int64_t step_s : {0, 3600, -7200, 3600}) {
    timespec wall = {};
    clock_gettime(CLOCK_REALTIME, &wall);
    wall.tv_sec += step_s;
    REQUIRE(clock_settime(CLOCK_REALTIME, &wall) == 0);
    const Stamp before = monotonicNow();
    REQUIRE(sender.send(frame).ok());
    std::optional<CanFrame> got;
    REQUIRE(nextOf(receiver, got).ok());
    REQUIRE(got);
    CHECK(got->arrival.ns >= before.ns - 1000);
    CHECK(got->arrival <= monotonicNow());
  }
  CHECK(receiver.counters().without_stamp == 0);
  // Stepped while a frame waits: its stamp is of another wall clock and is not believed.
  REQUIRE(sender.send(frame).ok());
  timespec wall = {};
  clock_gettime(CLOCK_REALTIME, &wall);
  wall.tv_sec += 3600;
  REQUIRE(clock_settime(CLOCK_REALTIME, &wall) == 0);
  const Stamp before = monotonicNow();
  std::optional<CanFrame> got;
  REQUIRE(nextOf(receiver, got).ok());
  REQUIRE(got);
  CHECK(got->arrival >= before);
  CHECK(receiver.counters().without_stamp == 1);
}

TEST_CASE("Bus-off and overflows are reported and counted, and bus-off ends with a restart or a frame",
          "[bus]") {
  CanBus sender;
  CanBus receiver;
  REQUIRE(sender.open(settings()).ok());
  REQUIRE(receiver.open(settings()).ok());
  std::optional<CanFrame> frame;
  REQUIRE(sender.send(errorFrame(0x4, 0x01)).ok());
  REQUIRE(sender.send(errorFrame(0x4, 0x10)).ok());
  CHECK(nextOf(receiver, frame).ok());
  CHECK(!frame);
  CHECK(receiver.counters().controller_overflows == 1);
  CHECK(receiver.counters().error_passive == 1);
  REQUIRE(sender.send(errorFrame(0x40)).ok());
  const DeviceFault off = nextOf(receiver, frame);
  std::printf("%s\n", describe(off, "CAN bus (vcan0)").c_str());
  CHECK(off.kind == DeviceFaultKind::kDown);
  CHECK(off.text().find("bus-off") != std::string::npos);
  CHECK(off.text().find("restart") != std::string::npos);
  CHECK(receiver.next(frame).kind == DeviceFaultKind::kDown);
  REQUIRE(sender.send(errorFrame(0x100)).ok());
  CHECK(nextOf(receiver, frame).ok());
  CHECK(receiver.counters().bus_off == 1);
  CHECK(receiver.counters().restarts == 1);
  REQUIRE(sender.send(errorFrame(0x40)).ok());
  CHECK(!nextOf(receiver, frame).ok());
  CanFrame data;
  data.id = 5;
  REQUIRE(sender.send(data).ok());
  CHECK(nextOf(receiver, frame).ok());
  CHECK(frame);
  CHECK(receiver.next(frame).ok());
  CHECK(receiver.counters().error_frames == 5);
}

TEST_CASE("A socket that is not read loses frames, and says how many", "[bus]") {
  CanBus sender;
  CanBus receiver;
  CanBusSettings small = settings();
  small.receive_buffer = 4096;
  REQUIRE(sender.open(settings()).ok());
  REQUIRE(receiver.open(small).ok());
  CanFrame frame;
  frame.id = 9;
  frame.size = 8;
  constexpr std::uint64_t kSent = 2000;
  for (std::uint64_t i = 0; i < kSent; ++i) REQUIRE(sender.send(frame).ok());
  std::optional<CanFrame> got;
  std::uint64_t received = 0;
  for (;; ++received) {
    REQUIRE(receiver.next(got).ok());
    if (!got) break;
  }
  // The count comes with the next frame.
  REQUIRE(sender.send(frame).ok());
  REQUIRE(nextOf(receiver, got).ok());
  CHECK(received < kSent);
  CHECK(receiver.counters().lost_in_socket == kSent - received);
}

TEST_CASE("An interface that goes down says how to bring it up, and goes on when it is", "[bus]") {
  const std::size_t files = sandbox::openFiles();
  {
    CanBus sender;
    CanBus receiver;
    REQUIRE(sender.open(settings()).ok());
    REQUIRE(receiver.open(settings()).ok());
    CanFrame data;
    data.id = 5;
    std::optional<CanFrame> frame;
    setUp(false);
    const DeviceFault down = nextOf(receiver, frame);
    std::printf("%s\n", describe(down, "CAN bus (vcan0)").c_str());
    CHECK(down.kind == DeviceFaultKind::kDown);
    CHECK(down.text() == "`ip link set vcan0 up`");
    CHECK(receiver.next(frame).kind == DeviceFaultKind::kDown);
    CHECK(receiver.isOpen());
    CHECK(receiver.counters().went_down == 1);
    CHECK(sender.send(data).kind == DeviceFaultKind::kDown);
    CanBus late;
    CHECK(late.open(settings()).kind == DeviceFaultKind::kDown);
    setUp(true);
    REQUIRE(receiver.next(frame).ok());
    REQUIRE(late.reopen().ok());
    REQUIRE(sender.send(data).ok());
    REQUIRE(nextOf(receiver, frame).ok());
    CHECK(frame);
    REQUIRE(nextOf(late, frame).ok());
    CHECK(frame);
  }
  CHECK(sandbox::openFiles() == files);
}

TEST_CASE("An interface that is removed is reported, and taken up when it is there again", "[bus]") {
  REQUIRE(std::system("ip link add vcan7 type vcan && ip link set vcan7 mtu 16 up") == 0);
  CanBusSettings seventh;
  seventh.setInterface("vcan7");
  CanBus bus;
  REQUIRE(bus.open(seventh).ok());
  seventh.fd = true;
  CanBus fd;
  const DeviceFault classic = fd.open(seventh);
  std::printf("%s\n", describe(classic, "CAN bus (vcan7)").c_str());
  CHECK(classic.kind == DeviceFaultKind::kUnsupported);
  CHECK(classic.text().find("fd on") != std::string::npos);
  REQUIRE(std::system("ip link del vcan7") == 0);
  std::optional<CanFrame> frame;
  DeviceFault fault;
  for (int i = 0; i < 5 && bus.isOpen(); ++i) fault = nextOf(bus, frame, 50);
  std::printf("%s\n", describe(fault, "CAN bus (vcan7)").c_str());
  CHECK(fault.kind == DeviceFaultKind::kUnplugged);
  CHECK(bus.reopen().kind == DeviceFaultKind::kMissing);
  REQUIRE(std::system("ip link add vcan7 type vcan && ip link set vcan7 up") == 0);
  CHECK(bus.reopen().ok());
  CHECK(bus.counters().reopened == 1);
  REQUIRE(std::system("ip link del vcan7") == 0);
}

TEST_CASE("Opening, sending, receiving, decoding and faults allocate nothing", "[bus]") {
  const CanBusSettings good = settings();
  CanBusSettings missing = good;
  missing.setInterface("no_such_can0");
  CanBus sender;
  CanBus receiver;
  RawImuDecoder decoder;
  ImuReading reading;
  const CanFrame off = errorFrame(0x40);
  std::optional<CanFrame> frame;
  int readings = 0;
  int faults = 0;
  const std::uint64_t before = test::allocationCount();
  faults += receiver.open(missing).ok() ? 0 : 1;
  faults += sender.open(good).ok() && receiver.open(good).ok() ? 0 : 100;
  for (std::uint64_t i = 0; i < 20; ++i) {
    const DroneCanFrames frames = canflight::frames(i, kNode, i % 2 == 0);
    for (std::size_t k = 0; k < frames.count; ++k) faults += sender.send(frames.frames[k]).ok() ? 0 : 100;
    while (receiver.next(frame).ok() && frame) readings += decoder.take(*frame, reading) ? 1 : 0;
  }
  faults += sender.send(off).ok() ? 0 : 100;
  faults += receiver.next(frame).ok() ? 0 : 1;
  const std::uint64_t allocated = test::allocationCount() - before;
  CHECK(readings == 20);
  CHECK(faults == 2);
  CHECK(allocated == 0);
}

}  // namespace
}  // namespace swiftlet
