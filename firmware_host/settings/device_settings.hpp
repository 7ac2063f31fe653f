#pragma once
// The vehicle's devices and its outputs to other programs, for `fly`, `record`, `doctor` and `hil`.

#include <string>

namespace swiftlet {

struct VehicleGroup {
  std::string calibration = "";
  std::string imu_calibration = "";
};

struct ImuLinkGroup {
  std::string device = "";  ///< serial port, CAN interface or udp:HOST:PORT; empty: none
  std::string topic = "";   ///< ROS 2 topic, instead of device
  std::string accel_topic = "";
  std::string protocol = "bridge";
  int baud = 921600;
  double rate_hz = 200;
  double delay_ms = 0;
  int can_node = 0;  ///< 0: any
};

/// Value of CamerasGroup::shutter for a rolling shutter.
inline constexpr const char* kRolling = "rolling";

/// Values of CamerasGroup::camera_info.
inline constexpr const char* kCameraInfoOff = "off";
inline constexpr const char* kCameraInfoCheck = "check";
inline constexpr const char* kCameraInfoUse = "use";

struct CamerasGroup {
  std::string device0 = "";
  std::string device1 = "";
  std::string pipeline0 = "";  ///< GStreamer pipeline, instead of device0
  std::string pipeline1 = "";
  std::string topic0 = "";  ///< ROS 2 topic, instead of device0
  std::string topic1 = "";
  std::string camera_info = kCameraInfoCheck;
  bool side_by_side = false;
  std::string format = "any";
  std::string resolution = "";  ///< width x height; used without a calibration
  double rate_hz = 20;
  double exposure_ms = 0;  ///< 0: the camera's own setting
  int gain = -1;           ///< negative: the camera's own setting
  bool exposure_control = false;
  std::string shutter = "global";
  double readout_ms = 0;
};

struct TriggerGroup {
  std::string chip = "";  ///< empty: no trigger line
  std::string line = "";  ///< empty: line 0 of a GPIO chip, all inputs of an IMU
  std::string edge = "rising";
  double delay_us = 0;
};

/// An autopilot that receives the estimate over MAVLink.
struct AutopilotGroup {
  std::string device = "";  ///< serial port or udp:HOST:PORT, may equal imu_link.device; empty: none
  int baud = 921600;
  int system = 1;
  double rate_hz = 40;
  std::string message = "odometry";
  bool obstacles = true;
  double roll_deg = 0;  ///< rotation of the IMU in the vehicle
  double pitch_deg = 0;
  double yaw_deg = 0;
  double arm_x = 0;  ///< m, from the IMU to the vehicle's reference point, in the IMU's axes
  double arm_y = 0;
  double arm_z = 0;
};

/// Topics for other processes, over DDS.
struct Ros2Group {
  bool enabled = false;
  int domain = 0;
  std::string interface = "lo";  ///< network interface; lo: this computer alone
  std::string driver = "none";   ///< driver whose topics are used for cameras and IMU
  double odometry_hz = 50;
  double mesh_hz = 5;
  std::string label_topic = "";  ///< label images for the map; empty: none
  double label_patience = 0.5;   ///< s, longest wait of the map for labels
};

/// The far ends of the devices above, for `hil`.
struct HilGroup {
  std::string output0 = "";
  std::string output1 = "";
  std::string trigger_pull = "";
};

}  // namespace swiftlet
