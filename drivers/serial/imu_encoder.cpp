#include "drivers/serial/imu_encoder.hpp"

#include "drivers/mavlink/mavlink_messages.hpp"

namespace swiftlet {

std::size_t encodeMavlink(const ImuReading& reading, MavlinkSender& sender, std::span<std::uint8_t> out) {
  constexpr std::int64_t kNsPerMicrosecond = 1'000;
  mavlink::HighresImu imu;
  imu.time_usec = static_cast<std::uint64_t>(reading.device.value_or(reading.arrival).ns / kNsPerMicrosecond);
  imu.accel = reading.accel.cast<float>();
  imu.gyro = reading.gyro.cast<float>();
  imu.fields_updated = mavlink::HighresImu::kAccelUpdated | mavlink::HighresImu::kGyroUpdated;
  return mavlink::write(sender, imu, out);
}

std::size_t ImuEncoder::encode(const ImuReading& reading, std::span<std::uint8_t> out) {
  switch (protocol_) {
    case ImuProtocol::kVectorNav:
      return encodeVectorNav(reading, out);
    case ImuProtocol::kXsens:
      return encodeXsens(reading, out);
    case ImuProtocol::kMip:
      return encodeMip(reading, out);
    case ImuProtocol::kMavlink:
      return encodeMavlink(reading, sender_, out);
    case ImuProtocol::kBridge:
      return encodeBridge(reading, {}, out);
  }
  return 0;
}

}  // namespace swiftlet
