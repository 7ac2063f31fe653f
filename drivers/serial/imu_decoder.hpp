#pragma once
// Decodes inertial samples from the bytes of a serial link: one type for all protocols.
//
// Use: feed() the bytes of a read, then next() until it returns false, then nextEdge() and nextMavlink().
// - Samples are in SI units and the sensor's own axes, with the sensor's clock unwrapped to 64 bits and the
//   arrival of the frame's first byte. They do not depend on how reads divided the bytes.
// - Every frame must have a valid checksum; after garbage the search continues byte by byte.
// - A sample with NaN or infinity, or with a clock out of range, is dropped and counted.
//
// The headers of VectorNav, Xsens, Mip and Bridge list the messages that are read. From MAVLink, one inertial
// message of one sender and one of its sensors is read: HIGHRES_IMU with new accelerations and rates, or
// RAW_IMU or SCALED_IMU (takeMavlink()); also CAMERA_TRIGGER as edges. nextMavlink() gives TIMESYNC,
// HEARTBEAT and COMMAND_ACK.
//
// Memory: about 93 kB inside the object, no allocation. Cost: 0.2 to 0.4 us per frame; at most, for
// adversarial garbage, 0.25 us per byte.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/device/stream_counters.hpp"
#include "drivers/mavlink/mavlink_link.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "drivers/serial/bridge.hpp"
#include "drivers/serial/device_count.hpp"
#include "drivers/serial/event_queue.hpp"
#include "drivers/serial/mip.hpp"
#include "drivers/serial/trigger_edge.hpp"
#include "drivers/serial/vectornav.hpp"
#include "drivers/serial/xsens.hpp"

namespace swiftlet {

enum class ImuProtocol : std::uint8_t { kVectorNav, kXsens, kMip, kMavlink, kBridge };
constexpr std::size_t kImuProtocolCount = 5;

/// "vectornav", "xsens", "mip", "mavlink", "bridge": names used in the settings.
std::string_view name(ImuProtocol protocol);
std::optional<ImuProtocol> imuProtocol(std::string_view name);

/// Sender of MAVLink readings.
struct MavlinkImuSource {
  std::uint8_t system = 0;
  std::uint8_t component = 0;
  std::uint8_t sensor = 0;  ///< id field of the message

  bool operator==(const MavlinkImuSource&) const = default;
};

/// A received MAVLink message other than samples and edges: TIMESYNC, HEARTBEAT or COMMAND_ACK.
struct ReceivedMavlink {
  Stamp arrival;  ///< of the first byte
  std::uint8_t system = 0;
  std::uint8_t component = 0;
  std::variant<mavlink::Timesync, mavlink::Heartbeat, mavlink::CommandAck> message;
};

class ImuDecoder {
 public:
  static constexpr std::size_t kMostFed = FrameBuffer<Xsens::kLongestFrame>::kMostFed;
  /// Capacity for edges, and for messages of nextMavlink(). All bytes that feed() accepts hold fewer of them,
  /// so none is lost if both queues are emptied after each read.
  static constexpr std::size_t kMostEvents = 512;

  explicit ImuDecoder(ImuProtocol protocol) : protocol_(protocol) {}

  /// Accepts bytes that a read returned at `read_at` (CLOCK_MONOTONIC); `byte_time` is the time of one byte
  /// on the wire, 0 on USB CDC. Returns how many were accepted: up to kMostFed bytes always, once next() has
  /// returned false.
  [[nodiscard]] std::size_t feed(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time) {
    return buffer_.feed(bytes, read_at, byte_time, counters_);
  }
  /// The next reading; false: more bytes are needed.
  bool next(ImuReading& reading);
  bool nextEdge(TriggerEdge& edge) { return edges_.pop(edge); }
  bool nextMavlink(ReceivedMavlink& message) { return received_.pop(message); }
  /// Selects the message for readings: HighresImu::kId (the default), ScaledImu::kRawId or kScaledId.
  void takeMavlink(std::uint32_t message);
  /// Sender of the MAVLink readings: the first that sends a complete one; empty before.
  [[nodiscard]] const std::optional<MavlinkImuSource>& mavlinkSource() const { return source_; }

  /// Call after the device was unplugged: discards a partial frame and the state of its clock and counters.
  /// Statistics and waiting messages are kept.
  void restart();

  [[nodiscard]] ImuProtocol protocol() const { return protocol_; }
  [[nodiscard]] const StreamCounters& counters() const { return counters_; }
  /// Bytes of a frame that is not yet complete.
  [[nodiscard]] std::size_t waiting() const { return buffer_.waiting(); }

 private:
  FrameCheck check(std::span<const std::uint8_t> bytes);
  void read(const StampedFrame& frame, InertialFrame& content);
  void readMavlink(const StampedFrame& frame, InertialFrame& content);
  void readHighresImu(const MavlinkFrame& frame, InertialFrame& content);
  void readScaledImu(const MavlinkFrame& frame, InertialFrame& content);
  bool isOurs(const MavlinkFrame& frame, std::uint8_t sensor);
  [[nodiscard]] Duration meanAge() const;
  bool give(const InertialFrame& content, Stamp arrival, ImuReading& reading);

  ImuProtocol protocol_;
  std::optional<MavlinkImuSource> source_;
  FrameBuffer<Xsens::kLongestFrame> buffer_;
  StreamCounters counters_;
  VectorNav vectornav_;
  Xsens xsens_;
  Bridge bridge_;
  MavlinkLink link_;
  WrappingCounter<std::uint32_t> mavlink_triggers_;
  std::uint32_t mavlink_message_ = mavlink::HighresImu::kId;
  std::optional<std::uint8_t> px4_;  ///< the system whose autopilot says that it is PX4
  SampleGaps gaps_;
  EventQueue<TriggerEdge, kMostEvents> edges_;
  EventQueue<ReceivedMavlink, kMostEvents> received_;
};

}  // namespace swiftlet
