#pragma once
// The MAVLink messages that report pose, obstacles and problems to an autopilot, field for field, in
// MAVLink's own units. Read and written like those of mavlink_messages.hpp. Offsets and units:
// docs/mavlink.md. Source: MAVLink common.xml.

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "drivers/mavlink/mavlink_frame.hpp"

namespace swiftlet::mavlink {

/// Upper triangle of a symmetric 6 x 6 matrix, row by row: the index of (r, c) with r <= c is 6 r - r (r - 1)
/// / 2 + c - r. The first element is NaN if nothing is known.
using Covariance21 = std::array<float, 21>;

enum class Frame : std::uint8_t {
  kLocalNed = 1,
  kBodyFrd = 12,
  kLocalFrd = 20,  ///< like NED, but with a heading not referenced to north
};

/// ODOMETRY.
struct Odometry {
  static constexpr std::uint32_t kId = 331;
  static constexpr std::uint8_t kVio = 3;     ///< MAV_ESTIMATOR_TYPE_VIO
  static constexpr std::int8_t kFailed = -1;  ///< quality: 1 to 100, 0 unknown, -1 failed

  std::uint64_t time_usec = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< [m] in `frame`
  std::array<float, 4> q = {1, 0, 0, 0};               ///< wxyz, `child` to `frame`
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();  ///< [m/s] in `child`
  Eigen::Vector3f rates = Eigen::Vector3f::Zero();     ///< [rad/s] in `child`
  Covariance21 pose_covariance = {};                   ///< x y z roll pitch yaw
  Covariance21 velocity_covariance = {};               ///< vx vy vz and the angular rates
  Frame frame = Frame::kLocalFrd;
  Frame child = Frame::kBodyFrd;
  std::uint8_t reset_counter = 0;  ///< increased when the pose jumps for any reason but motion
  std::uint8_t estimator = kVio;
  std::int8_t quality = 0;
};

/// VISION_POSITION_ESTIMATE, for autopilots that do not accept ODOMETRY.
struct VisionPositionEstimate {
  static constexpr std::uint32_t kId = 102;
  std::uint64_t usec = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< [m] forward, right, down
  Eigen::Vector3f rpy = Eigen::Vector3f::Zero();       ///< [rad] roll, pitch, yaw
  Covariance21 covariance = {};
  std::uint8_t reset_counter = 0;
};

/// OBSTACLE_DISTANCE: the nearest obstacle in each of up to 72 sectors around the vehicle, clockwise.
struct ObstacleDistance {
  static constexpr std::uint32_t kId = 330;
  static constexpr std::uint16_t kUnknown = 65535;
  static constexpr std::size_t kSectors = 72;
  static constexpr std::uint8_t kLaser = 0;  ///< sensor type; none of the defined types fits cameras

  std::uint64_t time_usec = 0;
  std::array<std::uint16_t, kSectors> distance_cm;  ///< kUnknown; values above max_cm: free
  std::uint16_t min_cm = 0;
  std::uint16_t max_cm = 0;
  std::uint8_t sensor = kLaser;
  float increment_deg = 5;  ///< width of a sector
  float offset_deg = 0;     ///< from forward to the middle of the first sector
  Frame frame = Frame::kBodyFrd;
};

/// STATUSTEXT. A text longer than kMostText is sent in chunks with the same id; the first shorter chunk is
/// the last.
struct StatusText {
  static constexpr std::uint32_t kId = 253;
  static constexpr std::size_t kMostText = 50;
  enum class Severity : std::uint8_t { kCritical = 2, kError = 3, kWarning = 4, kInfo = 6 };

  Severity severity = Severity::kInfo;
  std::string_view text;   ///< longer texts are cut; when read: in the frame, which must outlive it
  std::uint16_t id = 0;    ///< common to all chunks of a text; 0: not chunked
  std::uint8_t chunk = 0;  ///< number of the chunk, from 0
};

bool read(const MavlinkFrame& frame, Odometry& message);
bool read(const MavlinkFrame& frame, VisionPositionEstimate& message);
bool read(const MavlinkFrame& frame, ObstacleDistance& message);
bool read(const MavlinkFrame& frame, StatusText& message);

std::size_t write(MavlinkSender& sender, const Odometry& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const VisionPositionEstimate& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const ObstacleDistance& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const StatusText& message, std::span<std::uint8_t> out);

}  // namespace swiftlet::mavlink
