#pragma once
// Inertial readings out of the bytes of a serial link: one type for all protocols.
//
// Use: feed() what a read gave, then next() until it says false, then nextEdge() and nextMavlink().
// - Readings are in SI units and the sensor's own axes, with the sensor's clock unwrapped to 64 bits and the
//   arrival of the frame's first byte. They do not depend on how the bytes were cut into reads.
// - Nothing passes without its checksum; after garbage the search goes on byte by byte.
// - A reading with NaN or infinity, or with a clock out of range, is dropped and counted.
// Which messages each protocol reads: the headers of VectorNav, Xsens, Mip and Bridge. MAVLink gives one
// inertial message, of one sender and one of its sensors: HIGHRES_IMU whose accelerations and rates are both
// fresh, or, as takeMavlink() says, RAW_IMU or SCALED_IMU; and CAMERA_TRIGGER as edges. TIMESYNC, HEARTBEAT
// and COMMAND_ACK come out through nextMavlink().
//
// Memory: about 93 kB inside the object, nothing allocated. Cost: 0.2 to 0.4 us a frame; garbage made to cost
// the most, 0.25 us a byte.

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

/// "vectornav", "xsens", "mip", "mavlink", "bridge": as settings name it.
std::string_view name(ImuProtocol protocol);
std::optional<ImuProtocol> imuProtocol(std::string_view name);

/// Whose MAVLink messages count. Empty: the first that sends a complete HIGHRES_IMU, from then on.
struct MavlinkImuSource {
  std::optional<std::uint8_t> system;
  std::optional<std::uint8_t> component;
  std::optional<std::uint8_t> sensor;  ///< the message's id field
};

/// A message of an autopilot that came in beside the readings: TIMESYNC, request or answer, and two more.
struct ReceivedMavlink {
  Stamp arrival;  ///< of the first byte
  std::uint8_t system = 0;
  std::uint8_t component = 0;
  std::variant<mavlink::Timesync, mavlink::Heartbeat, mavlink::CommandAck> message;
};

class ImuDecoder {
 public:
  static constexpr std::size_t kMostFed = FrameBuffer<Xsens::kLongestFrame>::kMostFed;
  /// Edges, and messages of nextMavlink(), that can wait: more than the frames that hold one in all bytes
  /// that feed() takes, so that none is refused where they are asked for after each read.
  static constexpr std::size_t kMostEvents = 512;

  explicit ImuDecoder(ImuProtocol protocol, MavlinkImuSource source = {})
      : protocol_(protocol), source_(source), wanted_(source) {}

  /// Takes bytes that a read returned at `read_at` (CLOCK_MONOTONIC); `byte_time` is what one byte takes on
  /// the wire, 0 on USB CDC. Says how many it took: all of kMostFed bytes once next() has said false.
  [[nodiscard]] std::size_t feed(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time) {
    return buffer_.feed(bytes, read_at, byte_time, counters_);
  }
  /// The next reading; false: feed more.
  bool next(ImuReading& reading);
  bool nextEdge(TriggerEdge& edge) { return edges_.pop(edge); }
  bool nextMavlink(ReceivedMavlink& message) { return received_.pop(message); }
  /// Which message readings are taken from: HighresImu::kId at first, ScaledImu::kRawId or kScaledId.
  void takeMavlink(std::uint32_t message);

  /// After the device was gone: forgets half a frame and where its clock and counters stood. What was counted
  /// stays, and so does what waits.
  void restart();

  [[nodiscard]] ImuProtocol protocol() const { return protocol_; }
  [[nodiscard]] const StreamCounters& counters() const { return counters_; }
  /// Bytes that wait for the rest of their frame.
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
  MavlinkImuSource source_;
  MavlinkImuSource wanted_;
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
