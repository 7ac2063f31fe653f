// Names of ports, datagrams to and fro, and whole writes.

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/serial/pseudo_terminal.hpp"
#include "firmware_host/interfaces/link_port.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace test {

/// Datagrams from an address of its own to a port of this host.
class ForeignSender {
 public:
  ForeignSender(const char* from, std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in own = {};
    own.sin_family = AF_INET;
    ::inet_pton(AF_INET, from, &own.sin_addr);
    REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(port);
    ::inet_pton(AF_INET, "127.0.0.1", &to_.sin_addr);
  }
  ~ForeignSender() { ::close(socket_); }
  void send(const std::vector<std::uint8_t>& bytes) const {
    static_cast<void>(::sendto(socket_, bytes.data(), bytes.size(), 0,
                               reinterpret_cast<const sockaddr*>(&to_), sizeof to_));
  }

 private:
  int socket_;
  sockaddr_in to_ = {};
};

}  // namespace test
namespace {

TEST_CASE("A port's name is read, or refused with a remedy", "[autopilot]") {
  CHECK_FALSE(udpAddress("/dev/ttyS1", "autopilot.device"));
  const auto simple = udpAddress("udp:192.168.1.10:14550", "autopilot.device");
  REQUIRE(simple);
  CHECK(simple->host == "192.168.1.10");
  CHECK(simple->port == 14550);
  CHECK(simple->own_port == 0);
  const auto listening = udpAddress("udp:localhost:14580@14540", "autopilot.device");
  REQUIRE(listening);
  CHECK(listening->host == "localhost");
  CHECK(listening->own_port == 14540);
  for (const char* wrong : {"udp:", "udp:host", "udp:host:", "udp::14550", "udp:host:0", "udp:host:70000",
                            "udp:host:14550@", "udp:host:1x", "udp:host:14550@x"}) {
    INFO(wrong);
    try {
      static_cast<void>(udpAddress(wrong, "imu_link.device"));
      FAIL("was taken");
    } catch (const InputError& error) {
      CHECK(error.field == "imu_link.device");
      CHECK_FALSE(error.remedy.empty());
    }
  }
}

TEST_CASE("Datagrams arrive whole; of a host that was not named none are read", "[autopilot]") {
  LinkPort a("udp:127.0.0.1:24571@24572", 0);
  LinkPort b("udp:127.0.0.1:24572@24571", 0);
  LinkPort stranger("udp:127.0.0.2:24571@24573", 0);
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
  LinkPort to_stranger("udp:127.0.0.1:24573", 0);
  REQUIRE(to_stranger.open().ok());
  REQUIRE(to_stranger.write(sent).ok());
  stranger.wait(Duration::fromMilliseconds(1000));
  REQUIRE(stranger.read(bytes, count, read_at).ok());
  CHECK(count == 0);
}

TEST_CASE("A flood of foreign datagrams neither ends a read nor wakes anybody", "[autopilot]") {
  const std::vector<std::uint8_t> ours = {253, 1, 2, 3};
  const std::vector<std::uint8_t> foreign(64, 99);
  std::array<std::uint8_t, 512> bytes;
  std::size_t count = 0;
  Stamp read_at;
  struct Case {
    const char* device;
    const char* autopilot;  ///< where ours come from
    const char* stranger;   ///< where the flood comes from
  };
  // Of another port of the autopilot's host, and of another host where the autopilot's port is not agreed on.
  for (const Case& one : {Case{"udp:127.0.0.1:24576@24577", "udp:127.0.0.1:24577@24576", "other host"},
                          Case{"udp:127.0.0.1:24576", "", "other port"}}) {
    INFO(one.stranger);
    LinkPort port(one.device, 0);
    REQUIRE(port.open().ok());
    const bool agreed = *one.autopilot != 0;
    const int own = agreed ? 24577 : port.ownPort();
    const std::string to_us = "udp:127.0.0.1:" + std::to_string(own);
    LinkPort autopilot(to_us + "@24576", 0);
    REQUIRE(autopilot.open().ok());
    test::ForeignSender stranger(agreed ? "127.0.0.3" : "127.0.0.1", static_cast<std::uint16_t>(own));
    for (int i = 0; i < 5000; ++i) stranger.send(foreign);
    // Nothing has come for us: nobody is woken.
    const Stamp begin = monotonicNow();
    port.wait(Duration::fromMilliseconds(50));
    CHECK(monotonicNow() - begin >= Duration::fromMilliseconds(50));
    REQUIRE(autopilot.write(ours).ok());
    for (int i = 0; i < 5000; ++i) stranger.send(foreign);
    port.wait(Duration::fromMilliseconds(1000));
    REQUIRE(port.read(bytes, count, read_at).ok());
    CHECK(std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)) ==
          ours);
    REQUIRE(port.read(bytes, count, read_at).ok());
    CHECK(count == 0);
  }
}

TEST_CASE("An autopilot that sends from any port to an agreed one is heard", "[autopilot]") {
  LinkPort port("udp:127.0.0.1:24578@24579", 0);
  REQUIRE(port.open().ok());
  LinkPort autopilot("udp:127.0.0.1:24579", 0);  // from a port of the kernel's choice
  REQUIRE(autopilot.open().ok());
  const std::vector<std::uint8_t> sent = {253, 1, 2, 3};
  REQUIRE(autopilot.write(sent).ok());
  std::array<std::uint8_t, 512> bytes;
  std::size_t count = 0;
  Stamp read_at;
  port.wait(Duration::fromMilliseconds(1000));
  REQUIRE(port.read(bytes, count, read_at).ok());
  CHECK(count == sent.size());
}

TEST_CASE("Where nobody listens yet, datagrams are lost and no fault", "[autopilot]") {
  LinkPort port("udp:127.0.0.1:24580", 0);
  REQUIRE(port.open().ok());
  const std::vector<std::uint8_t> sent = {253, 1, 2, 3};
  std::array<std::uint8_t, 512> bytes;
  std::size_t count = 0;
  Stamp read_at;
  for (int i = 0; i < 20; ++i) {
    CHECK(port.write(sent).ok());
    CHECK(port.read(bytes, count, read_at).ok());
    CHECK(count == 0);
  }
}

TEST_CASE("A datagram has the address of the route that it takes, not of that at the start", "[autopilot]") {
  LinkPort port("udp:127.0.0.1:24580", 0);
  REQUIRE(port.open().ok());
  REQUIRE(port.write(std::vector<std::uint8_t>{253}).ok());
  sockaddr_in own = {};
  socklen_t length = sizeof own;
  REQUIRE(::getsockname(port.descriptor(), reinterpret_cast<sockaddr*>(&own), &length) == 0);
  CHECK(own.sin_addr.s_addr == htonl(INADDR_ANY));
}

TEST_CASE("A port that another has, and a host that is none, are faults", "[autopilot]") {
  LinkPort a("udp:127.0.0.1:24574@24575", 0);
  LinkPort again("udp:127.0.0.1:24574@24575", 0);
  REQUIRE(a.open().ok());
  CHECK(again.open().kind == DeviceFaultKind::kBusy);
  LinkPort nowhere("udp:no-such-host.invalid:14550", 0);
  CHECK(nowhere.open().kind == DeviceFaultKind::kMissing);
  LinkPort serial("/dev/no-such-port", 921'600);
  CHECK(serial.open().kind == DeviceFaultKind::kMissing);
}

TEST_CASE("Two settings name one port by the same words or by two names of it", "[autopilot]") {
  const ScratchFolder folder("same_port");
  PseudoTerminal imu, other;
  REQUIRE(imu.open().ok());
  REQUIRE(other.open().ok());
  const std::string by_id = folder.file("by-id");
  std::filesystem::create_symlink(imu.path(), by_id);
  CHECK(samePort(imu.path(), imu.path()));
  CHECK(samePort(by_id, imu.path()));
  CHECK(samePort("udp:127.0.0.1:14580@14540", "udp:127.0.0.1:14580@14540"));
  CHECK_FALSE(samePort(other.path(), imu.path()));
  CHECK_FALSE(samePort("udp:127.0.0.1:14550", imu.path()));
  CHECK_FALSE(samePort("/dev/no-such-port", "/dev/no-such-port-either"));
}

TEST_CASE("Answers go to the port that the other side sends from", "[autopilot]") {
  LinkPort ours("udp:127.0.0.1:24585@24586", 0);
  LinkPort theirs("udp:127.0.0.1:24586", 0);  // from a port of the kernel's choice, not 24585
  REQUIRE(ours.open().ok());
  REQUIRE(theirs.open().ok());
  const std::vector<std::uint8_t> noise = {7, 7, 7}, frame = {253, 1, 2, 3};
  std::array<std::uint8_t, 512> bytes;
  std::size_t count = 0;
  Stamp read_at;
  const auto hears = [&](const std::vector<std::uint8_t>& sent) {
    REQUIRE(theirs.write(sent).ok());
    ours.wait(Duration::fromMilliseconds(1000));
    REQUIRE(ours.read(bytes, count, read_at).ok());
    CHECK(count == sent.size());
    static_cast<void>(ours.write(frame));
    theirs.wait(Duration::fromMilliseconds(100));
    REQUIRE(theirs.read(bytes, count, read_at).ok());
    return count == frame.size();
  };
  CHECK_FALSE(hears(noise));
  CHECK(hears(frame));
}

TEST_CASE("A serial port that takes little gets whole writes in order, or refuses them", "[autopilot]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  LinkPort port(terminal.path(), 921'600);
  REQUIRE(port.open().ok());
  constexpr std::size_t kLength = 777;
  std::vector<std::uint8_t> sent, received;
  std::size_t refused = 0;
  std::array<std::uint8_t, 512> bytes;
  for (std::uint8_t i = 0; i < 200; ++i) {
    const std::vector<std::uint8_t> write(kLength, i);
    if (port.write(write).ok()) {
      sent.insert(sent.end(), write.begin(), write.end());
    } else {
      ++refused;
    }
    // A reader that falls behind.
    std::size_t count = 0;
    REQUIRE(terminal.receive(std::span(bytes).first(i % 2 == 0 ? 512 : 100), count).ok());
    received.insert(received.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
  }
  CHECK(refused > 10);
  CHECK(sent.size() > 10 * kLength);
  const Stamp begin = monotonicNow();
  while (received.size() < sent.size() && monotonicNow() - begin < Duration::fromMilliseconds(10'000)) {
    static_cast<void>(port.flush());
    std::size_t count = 0;
    REQUIRE(terminal.receive(bytes, count).ok());
    received.insert(received.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
  }
  CHECK(port.flush());
  CHECK(received == sent);
}

}  // namespace
}  // namespace swiftlet
