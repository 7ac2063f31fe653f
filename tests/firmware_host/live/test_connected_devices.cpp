// What `doctor` says is connected, on made-up machines.

#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "firmware_host/inputs/devices/connected_devices.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

void write(const std::string& path, const std::string& text) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path) << text;
}

std::vector<MachineLine> linesOf(const MachineReport& report, const std::string& what) {
  std::vector<MachineLine> lines;
  for (const MachineLine& line : report.lines) {
    if (line.what == what) lines.push_back(line);
  }
  return lines;
}

TEST_CASE("with nothing attached each kind has one line that says what to connect") {
  const ScratchFolder root("devices_none");
  const MachineReport report = connectedDevices(root.path());
  for (const char* what : {"serial port", "CAN interface", "GPIO chip"}) {
    const auto lines = linesOf(report, what);
    REQUIRE(lines.size() == 1);
    CHECK(lines[0].found == "none");
    CHECK(lines[0].verdict == MachineVerdict::kNote);
    CHECK_FALSE(lines[0].remedy.empty());
  }
}

TEST_CASE("a serial port is told by the name that stays") {
  const ScratchFolder root("devices_serial");
  write(root.file("dev/ttyUSB0"), "");
  write(root.file("dev/ttyACM3"), "");
  write(root.file("dev/tty1"), "");  // a console
  fs::create_directories(root.file("dev/serial/by-id"));
  fs::create_symlink("../../ttyUSB0", root.file("dev/serial/by-id/usb-FTDI_IMU-if00-port0"));
  const auto lines = linesOf(connectedDevices(root.path()), "serial port");
  REQUIRE(lines.size() == 2);
  CHECK(lines[0].found == root.file("dev/ttyACM3"));
  CHECK(lines[1].found == root.file("dev/serial/by-id/usb-FTDI_IMU-if00-port0") + " (ttyUSB0)");
  for (const MachineLine& line : lines) CHECK(line.verdict == MachineVerdict::kGood);
}

TEST_CASE("a port that this user may not open names the group to join") {
  const ScratchFolder root("devices_rights");
  write(root.file("dev/ttyUSB0"), "");
  write(root.file("dev/gpiochip0"), "");
  fs::permissions(root.file("dev/ttyUSB0"), fs::perms::none);
  fs::permissions(root.file("dev/gpiochip0"), fs::perms::none);
  if (access(root.file("dev/ttyUSB0").c_str(), R_OK) == 0) {
    // Root may open everything; tests/firmware_host/live/test_first_hour.cpp gives its rights away.
    SUCCEED("this user may open everything");
    return;
  }
  const MachineReport report = connectedDevices(root.path());
  const auto serial = linesOf(report, "serial port");
  REQUIRE(serial.size() == 1);
  CHECK(serial[0].verdict == MachineVerdict::kPoor);
  CHECK_THAT(serial[0].remedy, Catch::Contains("dialout"));
  const auto gpio = linesOf(report, "GPIO chip");
  REQUIRE(gpio.size() == 1);
  CHECK_THAT(gpio[0].remedy, Catch::Contains("gpio"));
}

TEST_CASE("CAN interfaces are told apart from others, with the command that brings each up") {
  const ScratchFolder root("devices_can");
  write(root.file("sys/class/net/eth0/type"), "1\n");
  write(root.file("sys/class/net/eth0/flags"), "0x1003\n");
  write(root.file("sys/class/net/can0/type"), "280\n");
  write(root.file("sys/class/net/can0/flags"), "0x40080\n");
  write(root.file("sys/class/net/can1/type"), "280\n");
  write(root.file("sys/class/net/can1/flags"), "0x400c1\n");
  write(root.file("sys/class/net/vcan0/type"), "280\n");
  write(root.file("sys/class/net/vcan0/flags"), "");
  const auto lines = linesOf(connectedDevices(root.path()), "CAN interface");
  REQUIRE(lines.size() == 3);
  CHECK(lines[0].found == "can0: down");
  CHECK(lines[0].verdict == MachineVerdict::kPoor);
  CHECK(lines[0].remedy == "`sudo ip link set can0 up type can bitrate 1000000 restart-ms 100`");
  CHECK(lines[1].found == "can1: up");
  CHECK(lines[1].verdict == MachineVerdict::kGood);
  CHECK(lines[1].remedy.empty());
  CHECK(lines[2].remedy == "`sudo ip link set vcan0 up`");
}

}  // namespace
}  // namespace swiftlet
