// The IMU's link on the kernel's virtual CAN bus, inside the sandbox.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/inputs/devices/can_imu_link.hpp"
#include "tests/drivers/can/flight.hpp"
#include "tests/firmware_host/live/imu_bench.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kNode = 42;
constexpr const char* kAdd = "ip link add vcan8 type vcan && ip link set vcan8 up";
constexpr const char* kRemove = "ip link del vcan8";

ImuLinkGroup linkSettings() {
  ImuLinkGroup settings;
  settings.device = "vcan8";
  settings.protocol = "dronecan";
  return settings;
}

TEST_CASE("A CAN IMU's link counts synchronizations of the bus's clock and its own returns", "[can link]") {
  REQUIRE(std::system(kAdd) == 0);
  CanImuLink link(linkSettings());
  REQUIRE(link.open().ok());
  CHECK(link.counters()["reopened"] == 0);
  CanBusSettings settings;
  settings.setInterface("vcan8");
  CanBus sender;
  REQUIRE(sender.open(settings).ok());
  CanFrame sync;
  sync.id = 4U << 8U | kNode;
  sync.size = 8;
  REQUIRE(sender.send(sync).ok());
  const DroneCanFrames frames = canflight::frames(0, kNode, false);
  for (std::size_t i = 0; i < frames.count; ++i) REQUIRE(sender.send(frames.frames[i]).ok());
  ImuReading reading;
  bool got = false;
  CHECK(test::soon([&] {
    static_cast<void>(link.receive(monotonicNow()));
    got = got || link.next(reading);
    return got;
  }));
  CHECK(link.counters()["time_syncs"] == 1);

  REQUIRE(std::system(kRemove) == 0);
  for (int i = 0; i < 5 && link.isOpen(); ++i) static_cast<void>(link.receive(monotonicNow()));
  CHECK_FALSE(link.isOpen());
  CHECK_FALSE(link.open().ok());
  REQUIRE(std::system(kAdd) == 0);
  CHECK(link.open().ok());
  CHECK(link.counters()["reopened"] == 1);
  REQUIRE(std::system(kRemove) == 0);
}

TEST_CASE("A receive buffer that this user may not enlarge is told once", "[can link]") {
  REQUIRE(std::system(kAdd) == 0);
  CanImuLink link(linkSettings());
  constexpr uid_t kNobody = 65534;
  REQUIRE(seteuid(kNobody) == 0);
  const DeviceFault fault = link.open();
  REQUIRE(seteuid(0) == 0);
  REQUIRE(fault.ok());
  DeviceFault remark;
  REQUIRE(link.nextRemark(remark));
  CHECK(remark.kind == DeviceFaultKind::kChanged);
  CHECK(remark.text().find("net.core.rmem_max") != std::string_view::npos);
  CHECK_FALSE(link.nextRemark(remark));
  REQUIRE(std::system(kRemove) == 0);
}

}  // namespace
}  // namespace swiftlet
