#include "firmware_host/inputs/devices/can_imu_link.hpp"

#include <nlohmann/json.hpp>

namespace swiftlet {
namespace {

// RawIMU broadcasts of any node.
constexpr CanFilter kRawImu{0x0003EB00, 0x00FFFF80};

}  // namespace

CanImuLink::CanImuLink(const ImuLinkGroup& settings)
    : decoder_(static_cast<std::uint8_t>(settings.can_node)) {
  settings_.setInterface(settings.device.c_str());
  settings_.addFilter(kRawImu);
}

DeviceFault CanImuLink::open() { return bus_.open(settings_); }

DeviceFault CanImuLink::receive(Stamp /*now*/) {
  first_ = count_ = 0;
  std::optional<CanFrame> frame;
  // A full round of frames that are all parts of readings.
  constexpr std::size_t kFramesOfReading = 8;
  for (std::size_t i = 0; i < kMostReadings * kFramesOfReading && count_ < kMostReadings; ++i) {
    if (const DeviceFault fault = bus_.next(frame); !fault.ok()) return fault;
    if (!frame) return {};
    if (decoder_.take(*frame, readings_[count_])) ++count_;
  }
  return {};
}

bool CanImuLink::next(ImuReading& reading) {
  if (first_ == count_) return false;
  reading = readings_[first_++];
  return true;
}

nlohmann::ordered_json CanImuLink::counters() const {
  const CanBusCounters& bus = bus_.counters();
  const DroneCanCounters& transfers = decoder_.transfers();
  const RawImuCounters& readings = decoder_.counters();
  return {{"frames", bus.frames},
          {"lost_in_socket", bus.lost_in_socket},
          {"error_frames", bus.error_frames},
          {"bus_off", bus.bus_off},
          {"controller_overflows", bus.controller_overflows},
          {"reopened", bus.reopened},
          {"transfers_lost", transfers.lost},
          {"transfers_broken", transfers.broken},
          {"checksum_failures", transfers.checksum},
          {"readings", readings.readings},
          {"malformed", readings.malformed},
          {"not_finite", readings.not_finite},
          {"other_nodes", readings.other_nodes}};
}

}  // namespace swiftlet
