// Serial ports on the kernel's own pseudo-terminals.

#include <catch2/catch.hpp>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include "drivers/serial/pseudo_terminal.hpp"
#include "drivers/serial/serial_port.hpp"
#include "tests/drivers/serial/decoding.hpp"

namespace swiftlet::test {
namespace {

using std::chrono::steady_clock;

Stamp now() { return Stamp{steady_clock::now().time_since_epoch().count()}; }

/// Sends all, waiting for the reader where it must.
void sendAll(PseudoTerminal& terminal, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    std::size_t taken = 0;
    if (!terminal.send(bytes, taken).ok()) return;
    bytes = bytes.subspan(taken);
    if (!bytes.empty()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

/// Reads until `count` readings are there or nothing came for `patience`.
std::vector<ImuReading> readReadings(SerialPort& port, ImuDecoder& decoder, std::size_t count,
                                     Duration patience) {
  std::vector<ImuReading> readings;
  std::array<std::uint8_t, ImuDecoder::kMostFed> bytes = {};
  for (Stamp last = now(); readings.size() < count && now() - last < patience;) {
    REQUIRE(port.wait(Duration::fromMilliseconds(50)).ok());
    std::size_t got = 0;
    Stamp read_at;
    REQUIRE(port.read(bytes, got, read_at).ok());
    if (got > 0) last = read_at;
    REQUIRE(decoder.feed(std::span(bytes).first(got), read_at, port.byteTime()) == got);
    ImuReading reading;
    while (decoder.next(reading)) readings.push_back(reading);
  }
  return readings;
}

TEST_CASE("400 readings a second come over a serial port without loss", "[serial][port]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  SerialPort port({terminal.path()});
  REQUIRE(port.open().ok());
  constexpr int kCount = 800;
  std::vector<Stamp> sent(kCount);
  std::thread sender([&] {
    ImuEncoder encoder(ImuProtocol::kBridge);
    auto at = steady_clock::now();
    for (int i = 0; i < kCount; ++i, at += std::chrono::microseconds(2500)) {
      std::this_thread::sleep_until(at);
      std::array<std::uint8_t, ImuEncoder::kLongestFrame> bytes = {};
      const std::size_t length = encoder.encode(readingNumber(i), bytes);
      sent[static_cast<std::size_t>(i)] = now();
      sendAll(terminal, std::span(bytes).first(length));
    }
  });
  ImuDecoder decoder(ImuProtocol::kBridge);
  const std::vector<ImuReading> readings =
      readReadings(port, decoder, kCount, Duration::fromMilliseconds(10'000));
  sender.join();
  REQUIRE(readings.size() == kCount);
  std::vector<Duration> late;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    CHECK(*readings[i].counter == i);
    CHECK(readings[i].arrival > sent[i]);
    late.push_back(readings[i].arrival - sent[i]);
  }
  const StreamCounters& c = decoder.counters();
  CHECK(c.skipped_bytes + c.checksum_failures + c.missing_samples == 0);
  std::sort(late.begin(), late.end());
  // A machine that is busy with others may be late now and then, never as a rule.
  CHECK(late[late.size() / 2] < Duration::fromMilliseconds(5));
}

TEST_CASE("Every protocol comes through a serial port as fast as it goes", "[serial][port]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    PseudoTerminal terminal;
    REQUIRE(terminal.open().ok());
    SerialPort port({terminal.path()});
    REQUIRE(port.open().ok());
    constexpr int kCount = 2000;
    ImuEncoder encoder(protocol);
    Bytes bytes;
    for (int i = 0; i < kCount; ++i) append(bytes, encoded(encoder, readingNumber(i)));
    std::thread sender([&] { sendAll(terminal, bytes); });
    ImuDecoder decoder(protocol);
    const auto readings = readReadings(port, decoder, kCount, Duration::fromMilliseconds(10'000));
    sender.join();
    REQUIRE(readings.size() == kCount);
    for (int i = 0; i < kCount; ++i)
      CHECK(readings[static_cast<std::size_t>(i)].device == readingNumber(i).device);
    CHECK(decoder.counters().skipped_bytes == 0);
  }
}

TEST_CASE("Every byte passes a port unchanged, both ways", "[serial][port]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  SerialPort port({terminal.path()});
  REQUIRE(port.open().ok());
  Bytes all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint8_t>(i);
  Bytes into(1000);
  std::size_t count = 0, taken = 0;
  Stamp read_at;
  REQUIRE(terminal.send(all, taken).ok());
  REQUIRE(taken == all.size());
  REQUIRE(port.wait(Duration::fromMilliseconds(1000)).ok());
  REQUIRE(port.read(into, count, read_at).ok());
  CHECK(Bytes(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(count)) == all);
  REQUIRE(port.write(all, Duration::fromMilliseconds(1000)).ok());
  count = 0;
  for (int turn = 0; turn < 100 && count == 0; ++turn) {
    REQUIRE(terminal.receive(into, count).ok());
    if (count == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(Bytes(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(count)) == all);
  // Nothing there is no fault.
  REQUIRE(port.read(into, count, read_at).ok());
  CHECK(count == 0);
}

TEST_CASE("What waited before the port was opened is not taken for new", "[serial][port]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  const Bytes old(100, 0x55);
  std::size_t taken = 0, count = 0;
  REQUIRE(terminal.send(old, taken).ok());
  SerialPort port({terminal.path()});
  REQUIRE(port.open().ok());
  Bytes into(200);
  Stamp read_at;
  REQUIRE(port.read(into, count, read_at).ok());
  CHECK(count == 0);
}

TEST_CASE("Rates up to 4 Mbaud are set and read back", "[serial][port]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  for (const unsigned baud : {9'600U, 115'200U, 230'400U, 921'600U, 1'234'567U, 4'000'000U}) {
    SerialPort port({terminal.path(), baud});
    INFO(baud);
    REQUIRE(port.open().ok());
    CHECK(port.baud() == baud);
    // A pseudo-terminal's baud rate means nothing.
    CHECK(port.byteTime() == Duration{});
    CHECK_FALSE(port.errors().has_value());
  }
  SerialPort fast({terminal.path(), 4'000'001});
  CHECK(fast.open().kind == DeviceFaultKind::kUnsupported);
  SerialPort none({terminal.path(), 0});
  CHECK(none.open().kind == DeviceFaultKind::kUnsupported);
}

TEST_CASE("A port that goes away is a fault, and can be taken up again", "[serial][port]") {
  const std::filesystem::path link =
      std::filesystem::temp_directory_path() / ("swiftlet_serial_" + std::to_string(now().ns));
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  std::filesystem::create_symlink(terminal.path(), link);
  SerialPort port({link.string()});
  REQUIRE(port.open().ok());
  terminal.hangUp();
  Bytes into(10);
  std::size_t count = 0;
  Stamp read_at;
  const Stamp begun = now();
  CHECK(port.wait(Duration::fromMilliseconds(60'000)).ok());
  CHECK(now() - begun < Duration::fromMilliseconds(30'000));
  CHECK(port.read(into, count, read_at).kind == DeviceFaultKind::kUnplugged);
  CHECK_FALSE(port.isOpen());
  CHECK(port.read(into, count, read_at).kind == DeviceFaultKind::kUnplugged);
  CHECK(port.wait(Duration{}).kind == DeviceFaultKind::kUnplugged);
  CHECK(port.write(into, Duration{}).kind == DeviceFaultKind::kUnplugged);
  std::filesystem::remove(link);
  CHECK(port.open().kind == DeviceFaultKind::kMissing);
  REQUIRE(terminal.open().ok());
  std::filesystem::create_symlink(terminal.path(), link);
  CHECK(port.open().ok());
  REQUIRE(terminal.send(into, count).ok());
  REQUIRE(port.wait(Duration::fromMilliseconds(1000)).ok());
  REQUIRE(port.read(into, count, read_at).ok());
  CHECK(count == 10);
  // Without a wait in between, the read itself tells.
  terminal.hangUp();
  CHECK(port.read(into, count, read_at).kind == DeviceFaultKind::kUnplugged);
  std::filesystem::remove(link);
}

TEST_CASE("What is no serial port is refused with its reason", "[serial]") {
  SerialPort missing({"/dev/swiftlet-no-such-port"});
  CHECK(missing.open().kind == DeviceFaultKind::kMissing);
  SerialPort null({"/dev/null"});
  CHECK(null.open().kind == DeviceFaultKind::kWrongDevice);
  CHECK_FALSE(null.isOpen());
}

TEST_CASE("A write that nobody takes ends in time", "[serial][port]") {
  PseudoTerminal terminal;
  REQUIRE(terminal.open().ok());
  SerialPort port({terminal.path()});
  REQUIRE(port.open().ok());
  const Bytes much(200'000, 0xAA);
  const Stamp begun = now();
  CHECK(port.write(much, Duration::fromMilliseconds(50)).kind == DeviceFaultKind::kFailed);
  CHECK(now() - begun < Duration::fromMilliseconds(5'000));
}

}  // namespace
}  // namespace swiftlet::test
