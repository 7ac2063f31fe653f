// EdgeSource on the kernel's own gpio-sim: HIL_GPIO_DEV names the chip, HIL_GPIO_SYSFS where its lines are
// pulled.
#include <poll.h>

#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/gpio/edge_source.hpp"
#include "drivers/gpio/gpio_chip.hpp"

namespace swiftlet {
namespace {

constexpr int kLine = 3;
constexpr std::int64_t kMs = 1'000'000;

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

void write(const std::string& path, const std::string& text) {
  INFO(path);
  std::ofstream file(path);
  file << text;
  file.close();
  REQUIRE(file.good());
}

std::int64_t now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::int64_t>(t.tv_sec) * 1000 * kMs + t.tv_nsec;
}

void sleepUntil(std::int64_t when) {
  const timespec t{when / (1000 * kMs), when % (1000 * kMs)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) != 0) {
  }
}

/// Pulls the simulated line and lets the kernel's interrupt thread run: edges closer together are one to it.
void pull(bool up, const std::string& chip = environment("HIL_GPIO_SYSFS")) {
  write(chip + "/sim_gpio" + std::to_string(kLine) + "/pull", up ? "pull-up" : "pull-down");
  sleepUntil(now() + kMs);
}

EdgeSourceSettings settings(EdgeInterface interface, EdgeKind edges = EdgeKind::kRising) {
  EdgeSourceSettings s;
  s.chip = environment("HIL_GPIO_DEV");
  s.line = std::to_string(kLine);
  s.edges = edges;
  s.period = {50 * kMs};
  s.interface = interface;
  return s;
}

std::vector<EdgeInterface> interfaces() {
  std::vector<EdgeInterface> all = {EdgeInterface::kKernel};
  if (EdgeSource::hasLibgpiod()) all.push_back(EdgeInterface::kLibgpiod);
  return all;
}

std::vector<EdgeEvent> readAll(EdgeSource& source) {
  std::vector<EdgeEvent> all;
  std::array<EdgeEvent, 7> some;  // not the size that the kernel is asked for at once
  std::size_t count = some.size();
  while (count == some.size()) {
    REQUIRE(source.read(some, count).ok());
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

TEST_CASE("400 edges at 20 Hz, each with its stamp, none missed", "[sandbox][gpio]") {
  for (const EdgeInterface interface : interfaces()) {
    pull(false);
    EdgeSource source;
    const DeviceFault fault = source.open(settings(interface));
    INFO(describe(fault, "trigger"));
    REQUIRE(fault.ok());
    CHECK(source.interface() == interface);
    constexpr int kEdges = 400;
    double worst = 0, sum = 0;
    const std::int64_t start = now() + 10 * kMs;
    for (int i = 0; i < kEdges; ++i) {
      sleepUntil(start + i * 50 * kMs);
      const std::int64_t before = now();
      pull(true);
      pollfd p{source.fd(), POLLIN, 0};
      REQUIRE(poll(&p, 1, 1000) == 1);
      const auto events = readAll(source);
      REQUIRE(events.size() == 1);
      CHECK(events[0].rising);
      CHECK(events[0].sequence.has_value() == (interface == EdgeInterface::kKernel));
      const std::int64_t late = events[0].stamp.ns - before;
      CHECK(late >= 0);
      CHECK(events[0].stamp.ns <= now());
      worst = std::max(worst, static_cast<double>(late));
      sum += static_cast<double>(late);
      sleepUntil(start + i * 50 * kMs + 25 * kMs);
      pull(false);
    }
    CHECK(source.edges() == kEdges);
    CHECK(source.missed() == 0);
    std::printf("%s: %d edges, none missed; write to stamp: mean %.1f us, worst %.1f us\n",
                interface == EdgeInterface::kKernel ? "kernel" : "libgpiod", kEdges, sum / kEdges / 1e3,
                worst / 1e3);
  }
}

TEST_CASE("Both edges, in order, with which is which", "[sandbox][gpio]") {
  for (const EdgeInterface interface : interfaces()) {
    pull(false);
    EdgeSource source;
    REQUIRE(source.open(settings(interface, EdgeKind::kBoth)).ok());
    for (int i = 0; i < 6; ++i) pull(i % 2 == 0);
    const auto events = readAll(source);
    REQUIRE(events.size() == 6);
    for (std::size_t i = 0; i < events.size(); ++i) {
      CHECK(events[i].rising == (i % 2 == 0));
      if (i > 0) CHECK(events[i].stamp > events[i - 1].stamp);
    }
  }
}

TEST_CASE("Edges that the kernel's queue could not hold are counted", "[sandbox][gpio]") {
  constexpr int kBurst = 100;
  pull(false);
  EdgeSource source;
  EdgeSourceSettings small = settings(EdgeInterface::kKernel);
  small.buffer = 16;
  REQUIRE(source.open(small).ok());
  for (int i = 0; i < kBurst; ++i) {
    pull(true);
    pull(false);
  }
  CHECK(readAll(source).size() < kBurst);
  pull(true);
  CHECK(readAll(source).size() == 1);
  CHECK(source.edges() + source.missed() == kBurst + 1);
  std::printf("burst of %d: %llu read, %llu counted as missed\n", kBurst + 1,
              static_cast<unsigned long long>(source.edges()),
              static_cast<unsigned long long>(source.missed()));

  if (!EdgeSource::hasLibgpiod()) return;
  source.close();
  pull(false);
  EdgeSource old;
  REQUIRE(old.open(settings(EdgeInterface::kLibgpiod)).ok());
  const std::int64_t start = now() + 10 * kMs;
  for (int i = 0; i < 40; ++i) {
    sleepUntil(start + i * 50 * kMs);
    pull(true);
    pull(false);
  }
  CHECK(readAll(old).size() == 16);
  sleepUntil(start + 40 * 50 * kMs);
  pull(true);
  CHECK(readAll(old).size() == 1);
  CHECK(old.edges() + old.missed() == 41);
}

TEST_CASE("A line that is held, lines and chips that are not there, what can be listed", "[sandbox][gpio]") {
  EdgeSource first, second;
  REQUIRE(first.open(settings(EdgeInterface::kAny)).ok());
  CHECK(first.interface() == EdgeInterface::kKernel);
  for (const EdgeInterface interface : interfaces()) {
    const DeviceFault busy = second.open(settings(interface));
    CHECK(busy.kind == DeviceFaultKind::kBusy);
    CHECK(busy.text().find("swiftlet") != std::string_view::npos);
  }
  EdgeSourceSettings wrong = settings(EdgeInterface::kAny);
  wrong.line = "999";
  CHECK(second.open(wrong).kind == DeviceFaultKind::kMissing);
  wrong.line = "no such name";
  CHECK(second.open(wrong).kind == DeviceFaultKind::kMissing);

  GpioChip chip;
  REQUIRE(chip.open(environment("HIL_GPIO_DEV")).ok());
  GpioLine line;
  REQUIRE(chip.line(kLine, line).ok());
  CHECK(line.used);
  CHECK(line.consumer == "swiftlet");
  REQUIRE(chip.line(kLine + 1, line).ok());
  CHECK(!line.used);
  first.close();
  EdgeSourceSettings by_label = settings(EdgeInterface::kAny);
  by_label.chip = chip.label();
  CHECK(second.open(by_label).ok());
  by_label.chip = chip.name();
  CHECK(second.open(by_label).ok());
  CHECK(chip.open("/dev/vcan_not_there").kind == DeviceFaultKind::kMissing);
}

TEST_CASE("A chip that goes is unplugged, and taken up again when it is back", "[sandbox][gpio]") {
  const std::string sysfs = environment("HIL_GPIO_SYSFS");
  // .../platform/gpio-sim.0/gpiochip0
  const std::string folder = sysfs.substr(0, sysfs.rfind('/'));
  const std::string device = folder.substr(folder.rfind('/') + 1);
  const std::string driver = "/sys/bus/platform/drivers/gpio-sim/";
  for (const EdgeInterface interface : interfaces()) {
    EdgeSource source;
    // By label: the number may be another one when it comes back.
    EdgeSourceSettings by_label = settings(interface);
    GpioChip chip;
    REQUIRE(chip.open("sandbox").ok());
    by_label.chip = chip.label();
    REQUIRE(source.open(by_label).ok());
    const std::string before_path = chip.path();
    const std::string before = folder + "/" + chip.name();
    chip.close();
    pull(false, before);
    pull(true, before);
    CHECK(readAll(source).size() == 1);
    write(driver + "unbind", device);
    std::array<EdgeEvent, 4> events;
    std::size_t count = 0;
    const DeviceFault gone = source.read(events, count);
    INFO(describe(gone, "trigger"));
    CHECK(gone.kind == DeviceFaultKind::kUnplugged);
    CHECK(count == 0);
    pollfd p{source.fd(), POLLIN, 0};
    CHECK(poll(&p, 1, 1000) == 1);
    CHECK(source.open(by_label).kind == DeviceFaultKind::kMissing);
    write(driver + "bind", device);
    DeviceFault back;
    for (int i = 0; i < 100; ++i) {
      sleepUntil(now() + 20 * kMs);
      back = source.open(by_label);
      if (back.ok()) break;
    }
    INFO(describe(back, "trigger"));
    REQUIRE(back.ok());
    REQUIRE(chip.open(by_label.chip).ok());
    pull(false, folder + "/" + chip.name());
    pull(true, folder + "/" + chip.name());
    CHECK(readAll(source).size() == 1);
    CHECK(source.edges() == 2);
    CHECK(source.missed() == 0);
    std::printf("unbound and bound: %s, then %s\n", before_path.c_str(), chip.path().c_str());
  }
}

}  // namespace
}  // namespace swiftlet
