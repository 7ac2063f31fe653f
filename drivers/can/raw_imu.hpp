#pragma once
// uavcan.equipment.ahrs.RawIMU (1003): encoding, decoding, and the decoder that turns CAN frames into
// readings.
//
// Little endian, 47 bytes: stamp u56 [us], interval f32 [s], rate f16 x 3, integral of the rate f32 x 3,
// specific force f16 x 3, its integral f32 x 3; then the covariance in f16. The number of covariance terms
// follows from the payload's length (classic) or is sent in 6 bits before them (FD), so that FD values start
// 6 bits off the byte boundary. Axes are the sensor's (forward, right, down by the message's definition): z
// reads -9.81 at rest. Source: dronecan/DSDL, uavcan/equipment/ahrs/1003.RawIMU.uavcan and
// uavcan/protocol/4.GlobalTimeSync.uavcan.

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>

#include "drivers/can/can_bus.hpp"
#include "drivers/can/dronecan_transfer.hpp"
#include "drivers/device/imu_reading.hpp"

namespace swiftlet {

struct RawImu {
  std::uint64_t stamp_us = 0;  ///< 56 bits; 0: unknown
  float interval = 0;  ///< [s] that the integrals cover; if not positive, only the newest values are valid
  Eigen::Vector3f rate = Eigen::Vector3f::Zero();            ///< newest [rad/s]
  Eigen::Vector3f rate_integral = Eigen::Vector3f::Zero();   ///< [rad]
  Eigen::Vector3f force = Eigen::Vector3f::Zero();           ///< newest [m/s^2]
  Eigen::Vector3f force_integral = Eigen::Vector3f::Zero();  ///< [m/s]
  std::array<float, 36> covariance = {};
  std::size_t covariance_count = 0;
};

inline constexpr std::size_t kMaxRawImuBytes = 120;  ///< with 36 covariance terms in FD

/// Message types of RawIMU and GlobalTimeSync.
[[nodiscard]] const DroneCanType& rawImuType();
inline constexpr std::uint16_t kGlobalTimeSyncType = 4;

/// False: the payload is too short or does not match its covariance count.
bool decodeRawImu(std::span<const std::uint8_t> payload, bool fd, RawImu& out);
/// Returns the bytes written, without FD padding. `covariance_count` is at most 36.
std::size_t encodeRawImu(const RawImu& imu, bool fd, std::span<std::uint8_t, kMaxRawImuBytes> out);

struct RawImuCounters {
  std::uint64_t readings = 0;
  std::uint64_t malformed = 0;    ///< length that no RawIMU has
  std::uint64_t not_finite = 0;   ///< NaN, infinity or an invalid interval
  std::uint64_t other_nodes = 0;  ///< samples of other nodes
  std::uint64_t time_syncs = 0;   ///< GlobalTimeSync frames: if there are any, stamps are in the bus's clock
};

/// Decodes the readings of one node. Memory: 22 KiB inside the object.
class RawImuDecoder {
 public:
  /// `node`: 1 to 127; 0: the first node that sends a valid sample, and only that one from then on.
  explicit RawImuDecoder(std::uint8_t node = 0) : node_(node) {}

  /// True: `out` holds a sample. Rate and force are means over the interval if the node sends integrals,
  /// which have a finer resolution than its newest values in 16 bits. `counter` is unwrapped from the
  /// transfer id by the smallest step, so a loss of 32 samples in a row is not seen.
  bool take(const CanFrame& frame, ImuReading& out);

  [[nodiscard]] std::uint8_t node() const { return node_; }
  [[nodiscard]] const RawImuCounters& counters() const { return counters_; }
  [[nodiscard]] const DroneCanCounters& transfers() const { return reassembler_.counters(); }

  /// Receive filters for RawIMU of any node and GlobalTimeSync.
  static void addFilters(CanBusSettings& settings);

 private:
  DroneCanReassembler reassembler_{rawImuType()};
  RawImuCounters counters_;
  std::uint8_t node_;
  bool counting_ = false;
  std::uint64_t counter_ = 0;
  std::uint8_t transfer_id_ = 0;
};

}  // namespace swiftlet
