// EdgeSource in builds without libgpiod: only the kernel's own events.
#include "drivers/gpio/edge_source.hpp"

namespace swiftlet {

bool EdgeSource::hasLibgpiod() { return false; }

DeviceFault EdgeSource::openLibgpiod(const std::string& /*path*/, std::uint32_t /*offset*/,
                                     EdgeKind /*edges*/) {
  return deviceFault(DeviceFaultKind::kUnsupported, 0, "built without libgpiod");
}

void EdgeSource::closeLibgpiod() {}

DeviceFault EdgeSource::readLibgpiod(std::span<EdgeEvent> /*out*/, std::size_t& /*count*/) {
  return deviceFault(DeviceFaultKind::kUnsupported, 0, "built without libgpiod");
}

}  // namespace swiftlet
