#pragma once
// The MAVLink messages by which an estimator tells an autopilot where it is, what is near, and what is wrong;
// field for field, in MAVLink's own units. Read and written as those of mavlink_messages.hpp.
// Offsets and units: docs/mavlink.md. Source: MAVLink common.xml.

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "drivers/mavlink/mavlink_frame.hpp"

namespace swiftlet::mavlink {

/// Upper triangle of a symmetric 6 x 6 matrix, row by row: index of (r, c) with r <= c is
/// 6 r - r (r - 1) / 2 + c - r. The first is NaN where nothing is known.
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
  static constexpr std::int8_t kFailed = -1;  ///< quality: 1 to 100, 0 unknown

  std::uint64_t time_usec = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< [m] in `frame`
  std::array<float, 4> q = {1, 0, 0, 0};               ///< wxyz, `child` to `frame`
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();  ///< [m/s] in `child`
  Eigen::Vector3f rates = Eigen::Vector3f::Zero();     ///< [rad/s] in `child`
  Covariance21 pose_covariance = {};                   ///< x y z roll pitch yaw
  Covariance21 velocity_covariance = {};               ///< vx vy vz and their rates
  Frame frame = Frame::kLocalFrd;
  Frame child = Frame::kBodyFrd;
  std::uint8_t reset_counter = 0;  ///< raised when the pose jumps for any reason but motion
  std::uint8_t estimator = kVio;
  std::int8_t quality = 0;
};

/// VISION_POSITION_ESTIMATE, for autopilots that do not take ODOMETRY.
struct VisionPositionEstimate {
  static constexpr std::uint32_t kId = 102;
  std::uint64_t usec = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< [m] forward, right, down
  Eigen::Vector3f rpy = Eigen::Vector3f::Zero();       ///< [rad] roll, pitch, yaw
  Covariance21 covariance = {};
  std::uint8_t reset_counter = 0;
};

/// OBSTACLE_DISTANCE: the nearest thing in each of up to 72 sectors around the vehicle, clockwise.
struct ObstacleDistance {
  static constexpr std::uint32_t kId = 330;
  static constexpr std::uint16_t kUnknown = 65535;
  static constexpr std::size_t kSectors = 72;
  static constexpr std::uint8_t kLaser = 0;  ///< sensor type: none of those named fits cameras

  std::uint64_t time_usec = 0;
  std::array<std::uint16_t, kSectors> distance_cm;  ///< kUnknown; above max_cm: nothing there
  std::uint16_t min_cm = 0;
  std::uint16_t max_cm = 0;
  std::uint8_t sensor = kLaser;
  float increment_deg = 5;  ///< a sector's width
  float offset_deg = 0;     ///< of the first sector's middle from forward
  Frame frame = Frame::kBodyFrd;
};

/// STATUSTEXT. A text longer than kMostText is sent in chunks with one id; the first shorter chunk is the
/// last.
struct StatusText {
  static constexpr std::uint32_t kId = 253;
  static constexpr std::size_t kMostText = 50;
  enum class Severity : std::uint8_t { kCritical = 2, kError = 3, kWarning = 4, kInfo = 6 };

  Severity severity = Severity::kInfo;
  std::string_view text;   ///< longer is cut; read: in the frame, which outlives it
  std::uint16_t id = 0;    ///< of a text in chunks; 0: whole
  std::uint8_t chunk = 0;  ///< its number, from 0
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
