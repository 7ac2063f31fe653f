#include <catch2/catch.hpp>

#include <cerrno>
#include <string>

#include "drivers/device/device_fault.hpp"

namespace swiftlet {
namespace {

TEST_CASE("A device's fault names the device, the cause and the remedy", "[device]") {
  const std::string text = describe(openFault(EACCES, "open for reading"), "IMU (/dev/ttyUSB0)");
  CHECK(text.find("IMU (/dev/ttyUSB0)") == 0);
  CHECK(text.find("open for reading") != std::string::npos);
  CHECK(text.find("Permission denied") != std::string::npos);
  CHECK(text.find("group") != std::string::npos);
}

TEST_CASE("What open() says becomes a kind of fault", "[device]") {
  CHECK(openFault(ENOENT, "").kind == DeviceFaultKind::kMissing);
  CHECK(openFault(EPERM, "").kind == DeviceFaultKind::kNoRights);
  CHECK(openFault(EBUSY, "").kind == DeviceFaultKind::kBusy);
  CHECK(openFault(EIO, "").kind == DeviceFaultKind::kFailed);
  CHECK(DeviceFault{}.ok());
}

TEST_CASE("A detail that is too long is cut, not lost", "[device]") {
  const std::string many(1000, 'x');
  const DeviceFault fault = deviceFault(DeviceFaultKind::kUnsupported, 0, "offers %s", many.c_str());
  CHECK(fault.text().size() == fault.detail.size() - 1);
  CHECK(fault.text().substr(0, 8) == "offers x");
}

}  // namespace
}  // namespace swiftlet
