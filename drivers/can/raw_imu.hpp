#pragma once
// uavcan.equipment.ahrs.RawIMU (1003): its bytes both ways, and the decoder that makes readings of CAN
// frames.
//
// Little endian, 47 bytes: stamp u56 [us], interval f32 [s], rate f16 x 3, integral of the rate f32 x 3,
// specific force f16 x 3, integral of it f32 x 3; then the covariance in f16, its count from the payload's
// length (classic) or in 6 bits before it (FD), which puts its values 6 bits off the bytes. Axes are the
// sensor's (forward, right, down by the message's definition): z reads -9.81 at rest. Source: dronecan/DSDL,
// uavcan/equipment/ahrs/1003.RawIMU.uavcan and uavcan/protocol/4.GlobalTimeSync.uavcan.

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
  float interval = 0;          ///< seconds that the integrals cover; not above 0: only the newest are valid
  Eigen::Vector3f rate = Eigen::Vector3f::Zero();            ///< newest [rad/s]
  Eigen::Vector3f rate_integral = Eigen::Vector3f::Zero();   ///< [rad]
  Eigen::Vector3f force = Eigen::Vector3f::Zero();           ///< newest [m/s^2]
  Eigen::Vector3f force_integral = Eigen::Vector3f::Zero();  ///< [m/s]
  std::array<float, 36> covariance = {};
  std::size_t covariance_count = 0;
};

inline constexpr std::size_t kMaxRawImuBytes = 120;  ///< 36 terms in FD

/// RawIMU and GlobalTimeSync.
[[nodiscard]] const DroneCanType& rawImuType();
inline constexpr std::uint16_t kGlobalTimeSyncType = 4;

/// False: too short, or a count that the payload cannot hold.
bool decodeRawImu(std::span<const std::uint8_t> payload, bool fd, RawImu& out);
/// Bytes written; without FD padding. `covariance_count` is at most 36.
std::size_t encodeRawImu(const RawImu& imu, bool fd, std::span<std::uint8_t, kMaxRawImuBytes> out);

struct RawImuCounters {
  std::uint64_t readings = 0;
  std::uint64_t malformed = 0;    ///< a length that no RawIMU has
  std::uint64_t not_finite = 0;   ///< NaN, infinity, or an interval that is none
  std::uint64_t other_nodes = 0;  ///< of nodes that are not ours
  std::uint64_t time_syncs = 0;   ///< GlobalTimeSync frames: with them, stamps are of the bus's clock
};

/// One node's readings. Memory: 22 KiB inside the object.
class RawImuDecoder {
 public:
  /// `node` 1 to 127; 0: the first node with a valid sample, and only that one from then on.
  explicit RawImuDecoder(std::uint8_t node = 0) : node_(node) {}

  /// True: `out` holds a sample. Rate and force are the means over the interval if the node provides one;
  /// they are finer than its newest values in 16 bits. `counter` follows the transfer id by the smallest
  /// step: 32 samples lost in a row are not noticed in it.
  bool take(const CanFrame& frame, ImuReading& out);

  [[nodiscard]] std::uint8_t node() const { return node_; }
  [[nodiscard]] const RawImuCounters& counters() const { return counters_; }
  [[nodiscard]] const DroneCanCounters& transfers() const { return reassembler_.counters(); }

  /// RawIMU of any node, and GlobalTimeSync.
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
