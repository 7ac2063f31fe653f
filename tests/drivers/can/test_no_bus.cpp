#include <catch2/catch.hpp>

#include <string>

#include "drivers/can/can_bus.hpp"

namespace swiftlet {
namespace {

TEST_CASE("A bus that is not there says what to do, and gives nothing", "[can]") {
  for (const char* name : {"no_such_can0", ""}) {
    CanBusSettings settings;
    settings.setInterface(name);
    CanBus bus;
    const DeviceFault fault = bus.open(settings);
    // Not every kernel that runs this test has CAN at all.
    const bool known = fault.kind == DeviceFaultKind::kMissing || fault.kind == DeviceFaultKind::kUnsupported;
    CHECK(known);
    CHECK(fault.text().find('`') != std::string::npos);
    CHECK(!bus.isOpen());
    std::optional<CanFrame> frame;
    CHECK(bus.next(frame).kind == DeviceFaultKind::kUnplugged);
    CHECK(!frame);
    CHECK(bus.send({}).kind == DeviceFaultKind::kUnplugged);
    CHECK(bus.reopen().kind == fault.kind);
  }
}

TEST_CASE("A name longer than any interface's is refused, not cut to another's", "[can]") {
  const std::string first_of_it = "can_of_the_fron";
  for (const std::string& rest :
       {std::string("t"), std::string("t_left_wing_and_much_more_than_the_settings_hold")}) {
    CanBusSettings settings;
    settings.setInterface((first_of_it + rest).c_str());
    CanBus bus;
    const DeviceFault fault = bus.open(settings);
    CHECK(fault.kind == DeviceFaultKind::kMissing);
    CHECK(fault.text().find(first_of_it + "t") != std::string::npos);
    CHECK(fault.text().find("at most 15 characters") != std::string::npos);
    CHECK(!bus.isOpen());
  }
}

TEST_CASE("An FD frame has only certain lengths", "[can]") {
  CHECK(fdFrameSize(0) == 0);
  CHECK(fdFrameSize(7) == 7);
  CHECK(fdFrameSize(9) == 12);
  CHECK(fdFrameSize(33) == 48);
  CHECK(fdFrameSize(49) == 64);
}

}  // namespace
}  // namespace swiftlet
