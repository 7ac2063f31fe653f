#include "firmware_host/inputs/devices/can_imu_link.hpp"

#include <nlohmann/json.hpp>

namespace swiftlet {

CanImuLink::CanImuLink(const ImuLinkGroup& settings)
    : decoder_(static_cast<std::uint8_t>(settings.can_node)) {
  settings_.setInterface(settings.device.c_str());
  RawImuDecoder::addFilters(settings_);
}

DeviceFault CanImuLink::open() {
  if (opened_) return bus_.reopen();
  const DeviceFault fault = bus_.open(settings_);
  opened_ = fault.ok();
  return fault;
}

DeviceFault CanImuLink::receive(Stamp /*now*/) {
  first_ = count_ = 0;
  std::optional<CanFrame> frame;
  // At most so many frames: a full round of readings of eight frames each.
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

bool CanImuLink::nextRemark(DeviceFault& remark) {
  if (warned_ || bus_.warning().ok()) return false;
  warned_ = true;
  remark = bus_.warning();
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
          {"other_nodes", readings.other_nodes},
          {"time_syncs", readings.time_syncs}};
}

}  // namespace swiftlet
