// Names of ports, and datagrams to and fro.

#include <catch2/catch.hpp>
#include <filesystem>
#include <vector>

#include "drivers/calibration/input_error.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/autopilot/autopilot_port.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

TEST_CASE("A port's name is read, or refused with a remedy", "[autopilot]") {
  CHECK_FALSE(udpAddress("/dev/ttyS1"));
  const auto simple = udpAddress("udp:192.168.1.10:14550");
  REQUIRE(simple);
  CHECK(simple->host == "192.168.1.10");
  CHECK(simple->port == 14550);
  CHECK(simple->own_port == 0);
  const auto listening = udpAddress("udp:localhost:14580@14540");
  REQUIRE(listening);
  CHECK(listening->host == "localhost");
  CHECK(listening->own_port == 14540);
  for (const char* wrong : {"udp:", "udp:host", "udp:host:", "udp::14550", "udp:host:0", "udp:host:70000",
                            "udp:host:14550@", "udp:host:1x", "udp:host:14550@x"}) {
    INFO(wrong);
    try {
      static_cast<void>(udpAddress(wrong));
      FAIL("was taken");
    } catch (const InputError& error) {
      CHECK(error.field == "autopilot.device");
      CHECK_FALSE(error.remedy.empty());
    }
  }
}

TEST_CASE("Datagrams arrive whole; of a host that was not named none are read", "[autopilot]") {
  AutopilotPort a("udp:127.0.0.1:24571@24572", 0);
  AutopilotPort b("udp:127.0.0.1:24572@24571", 0);
  AutopilotPort stranger("udp:127.0.0.2:24571@24573", 0);
  REQUIRE(a.open().ok());
  // Nobody is there yet.
  const std::vector<std::uint8_t> sent = {1, 2, 3, 253, 0, 7};
  static_cast<void>(a.write(sent));
  REQUIRE(b.open().ok());
  REQUIRE(stranger.open().ok());
  std::array<std::uint8_t, 512> bytes;
  std::size_t count = 0;
  Stamp read_at;
  REQUIRE(a.read(bytes, count, read_at).ok());
  CHECK(count == 0);
  REQUIRE(a.write(sent).ok());
  b.wait(Duration::fromMilliseconds(1000));
  REQUIRE(b.read(bytes, count, read_at).ok());
  CHECK(std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)) == sent);
  CHECK(read_at > Stamp{});
  // It wants 127.0.0.2 and hears 127.0.0.1.
  AutopilotPort to_stranger("udp:127.0.0.1:24573", 0);
  REQUIRE(to_stranger.open().ok());
  REQUIRE(to_stranger.write(sent).ok());
  stranger.wait(Duration::fromMilliseconds(1000));
  REQUIRE(stranger.read(bytes, count, read_at).ok());
  CHECK(count == 0);
}

TEST_CASE("A port that another has, and a host that is none, are faults", "[autopilot]") {
  AutopilotPort a("udp:127.0.0.1:24574@24575", 0);
  AutopilotPort again("udp:127.0.0.1:24574@24575", 0);
  REQUIRE(a.open().ok());
  CHECK(again.open().kind == DeviceFaultKind::kBusy);
  AutopilotPort nowhere("udp:no-such-host.invalid:14550", 0);
  CHECK(nowhere.open().kind == DeviceFaultKind::kMissing);
  AutopilotPort serial("/dev/no-such-port", 921'600);
  CHECK(serial.open().kind == DeviceFaultKind::kMissing);
}

TEST_CASE("The IMU's port is refused, by its other name too", "[autopilot]") {
  const ScratchFolder folder("own_port");
  PseudoTerminal imu, other;
  REQUIRE(imu.open().ok());
  REQUIRE(other.open().ok());
  const std::string by_id = folder.file("by-id");
  std::filesystem::create_symlink(imu.path(), by_id);
  CHECK_NOTHROW(checkOwnPort(other.path(), imu.path()));
  CHECK_NOTHROW(checkOwnPort("udp:127.0.0.1:14550", imu.path()));
  CHECK_NOTHROW(checkOwnPort(imu.path(), ""));
  CHECK_NOTHROW(checkOwnPort("/dev/no-such-port", "/dev/no-such-port-either"));
  for (const std::string& device : {imu.path(), by_id}) {
    INFO(device);
    try {
      checkOwnPort(device, imu.path());
      FAIL("was taken");
    } catch (const InputError& error) {
      CHECK(error.field == "autopilot.device");
      CHECK(std::string(error.what()).find(device) != std::string::npos);
      CHECK_FALSE(error.remedy.empty());
    }
  }
}

}  // namespace
}  // namespace swiftlet
