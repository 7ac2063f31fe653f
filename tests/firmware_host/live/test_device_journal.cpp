// Each fault is told once, and its end once.

#include <catch2/catch.hpp>
#include <vector>

#include "firmware_host/interfaces/device_journal.hpp"

namespace swiftlet {
namespace {

constexpr Stamp at(int second) { return {second * 1'000'000'000LL}; }

TEST_CASE("a fault that stands is told once, and so is its end") {
  DeviceJournal journal("IMU (/dev/ttyUSB0, bridge)");
  journal.works(at(1));  // nothing stood
  for (int i = 2; i < 10; ++i)
    journal.fault(at(i), deviceFault(DeviceFaultKind::kSilent, 0, "nothing came for %d s", i));
  journal.works(at(10));
  journal.works(at(11));
  DeviceEvent event;
  REQUIRE(journal.next(event));
  CHECK(event.stamp == at(2));
  CHECK(
      journal.text(event) ==
      "IMU (/dev/ttyUSB0, bridge): sends nothing (nothing came for 2 s); check its power, its wires and that "
      "its output is enabled");
  REQUIRE(journal.next(event));
  CHECK(event.stamp == at(10));
  CHECK(journal.text(event) == "IMU (/dev/ttyUSB0, bridge): works again");
  CHECK_FALSE(journal.next(event));
  CHECK(journal.faults() == 1);
}

TEST_CASE("another fault is told while one stands, the same after it has ended too") {
  DeviceJournal journal("camera 0");
  journal.fault(at(1), deviceFault(DeviceFaultKind::kUnplugged, 0, "gone"));
  // What went is looked for and not there: nothing new.
  journal.fault(at(2), deviceFault(DeviceFaultKind::kMissing, 0, "not there"));
  journal.fault(at(2), deviceFault(DeviceFaultKind::kNoRights, 0, "another user's"));
  journal.works(at(3));
  journal.fault(at(4), deviceFault(DeviceFaultKind::kUnplugged, 0, "gone"));
  std::vector<DeviceFaultKind> kinds;
  DeviceEvent event;
  while (journal.next(event)) kinds.push_back(event.fault.kind);
  CHECK(kinds == std::vector{DeviceFaultKind::kUnplugged, DeviceFaultKind::kNoRights, DeviceFaultKind::kNone,
                             DeviceFaultKind::kUnplugged});
  CHECK(journal.faults() == 3);
}

TEST_CASE("a journal that nobody reads counts what it loses and keeps the oldest") {
  DeviceJournal journal("camera 0");
  constexpr int kRounds = 100;
  for (int i = 0; i < kRounds; ++i) {
    journal.fault(at(2 * i), deviceFault(DeviceFaultKind::kSilent, 0, "%d", i));
    journal.works(at(2 * i + 1));
  }
  DeviceEvent event;
  REQUIRE(journal.next(event));
  CHECK(event.stamp == at(0));
  std::uint64_t kept = 1;
  while (journal.next(event)) ++kept;
  CHECK(journal.lost() > 0);
  CHECK(kept + journal.lost() == 2 * kRounds);
  CHECK(journal.faults() == kRounds);
}

}  // namespace
}  // namespace swiftlet
