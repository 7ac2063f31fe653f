#include <catch2/catch.hpp>

#include <array>
#include <string>

#include "drivers/gpio/edge_source.hpp"
#include "drivers/gpio/gpio_chip.hpp"

namespace swiftlet {
namespace {

TEST_CASE("Chips that are not there, and nodes that are no chip", "[gpio]") {
  GpioChip chip;
  CHECK(chip.open("/dev/gpiochip_not_there").kind == DeviceFaultKind::kMissing);
  CHECK(chip.open("/dev/null").kind == DeviceFaultKind::kWrongDevice);
  const DeviceFault unnamed = chip.open("no chip has this label");
  const bool said = unnamed.kind == DeviceFaultKind::kMissing || unnamed.kind == DeviceFaultKind::kNoRights;
  CHECK(said);
  CHECK(chip.open("").kind == unnamed.kind);
  CHECK(chip.fd() < 0);
}

TEST_CASE("A source that did not open reads a fault, not edges", "[gpio]") {
  EdgeSource source;
  CHECK(source.open({.chip = "/dev/null", .line = "3"}).kind == DeviceFaultKind::kWrongDevice);
  CHECK(!source.isOpen());
  std::array<EdgeEvent, 4> events;
  std::size_t count = 7;
  CHECK(!source.read(events, count).ok());
  CHECK(count == 0);
}

}  // namespace
}  // namespace swiftlet
