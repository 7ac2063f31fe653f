#include <catch2/catch.hpp>

#include <vector>

#include "firmware_host/inputs/devices/image_watch.hpp"
#include "firmware_host/inputs/devices/rate_watch.hpp"
#include "firmware_host/interfaces/device_journal.hpp"

namespace swiftlet {
namespace {

Stamp at(double seconds) { return Stamp{} + Duration::fromSeconds(seconds); }

/// Messages at `rate` from `begin` to `end`; the verdicts of the seconds.
std::vector<double> feed(RateWatch& watch, double begin, double end, double rate) {
  std::vector<double> seen;
  for (int i = 0; begin + i / rate < end; ++i) {
    if (watch.add(at(begin + i / rate), 1)) seen.push_back(watch.seen());
  }
  return seen;
}

TEST_CASE("A rate is counted second by second", "[live]") {
  RateWatch watch(20);
  const std::vector<double> seen = feed(watch, 0, 3.01, 20);
  REQUIRE(seen.size() == 3);
  for (const double rate : seen) CHECK(rate == Approx(20));
  CHECK_FALSE(watch.tooFew());
  CHECK_FALSE(watch.tooMany());
}

TEST_CASE("A rate far from the expected one is wrong, one frame is not", "[live]") {
  RateWatch watch(20);
  feed(watch, 0, 1.2, 19);
  CHECK_FALSE(watch.tooFew());
  watch.restart(at(5));
  feed(watch, 5.1, 6.3, 10);
  CHECK(watch.tooFew());
  watch.restart(at(7));
  feed(watch, 7.025, 8.1, 40);
  CHECK(watch.tooMany());
  RateWatch unknown(0);
  feed(unknown, 0, 2, 3);
  CHECK_FALSE(unknown.tooFew());
  CHECK_FALSE(unknown.tooMany());
}

TEST_CASE("Silence before a restart is not counted as loss", "[live]") {
  RateWatch watch(20);
  feed(watch, 0, 0.5, 20);
  watch.restart(at(9));
  CHECK(feed(watch, 9.05, 10.1, 20).size() == 1);
  CHECK_FALSE(watch.tooFew());
}

struct Picture {
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(640 * 480, 90);
  [[nodiscard]] ImageView view() const { return {pixels.data(), 640, 480, 640}; }
};

TEST_CASE("An image equal to the one before is a repeated one, a dark one is dark", "[live]") {
  ImageWatch watch;
  Picture picture;
  CHECK(watch.look(picture.view()) == ImageWatch::Look::kNew);
  CHECK(watch.look(picture.view()) == ImageWatch::Look::kRepeated);
  CHECK(watch.look(picture.view()) == ImageWatch::Look::kRepeated);
  // One level of one pixel in a row that is read.
  picture.pixels[37 * 640 + 5] = 91;
  CHECK(watch.look(picture.view()) == ImageWatch::Look::kNew);
  Picture dark;
  dark.pixels.assign(dark.pixels.size(), 12);
  CHECK(watch.look(dark.view()) == ImageWatch::Look::kDark);
  CHECK(watch.look(dark.view()) == ImageWatch::Look::kDark);
  dark.pixels.assign(dark.pixels.size(), 13);
  CHECK(watch.look(dark.view()) == ImageWatch::Look::kNew);
}

TEST_CASE("A journal keeps what a working device does badly beside its fault", "[live]") {
  DeviceJournal journal("IMU (x)");
  const DeviceFault lossy = deviceFault(DeviceFaultKind::kLossy, 0, "1 of 2");
  const DeviceFault silent = deviceFault(DeviceFaultKind::kSilent, 0, "nothing");
  journal.defect(at(1), lossy);
  journal.defect(at(2), lossy);
  journal.fault(at(3), silent);
  journal.works(at(4));
  journal.sound(at(5));
  journal.sound(at(6));
  std::vector<std::string> lines;
  DeviceEvent event;
  while (journal.next(event)) lines.push_back(journal.text(event));
  REQUIRE(lines.size() == 4);
  CHECK(lines[0].starts_with("IMU (x): loses data (1 of 2); "));
  CHECK(lines[1].starts_with("IMU (x): sends nothing (nothing); "));
  CHECK(lines[2] == "IMU (x): works again");
  CHECK(lines[3] == "IMU (x): normal again");
  CHECK(journal.faults() == 2);
}

TEST_CASE("A device that went is told once, not again while it is looked for", "[live]") {
  DeviceJournal journal("camera 0 (x)");
  journal.fault(at(1), deviceFault(DeviceFaultKind::kUnplugged, 0, "read"));
  journal.fault(at(2), deviceFault(DeviceFaultKind::kMissing, 0, "open"));
  journal.fault(at(3), deviceFault(DeviceFaultKind::kNoRights, 0, "open"));
  DeviceEvent event;
  REQUIRE(journal.next(event));
  CHECK(event.fault.kind == DeviceFaultKind::kUnplugged);
  REQUIRE(journal.next(event));
  CHECK(event.fault.kind == DeviceFaultKind::kNoRights);
  CHECK_FALSE(journal.next(event));
}

}  // namespace
}  // namespace swiftlet
