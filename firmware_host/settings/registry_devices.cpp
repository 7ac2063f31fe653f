#include "firmware_host/settings/setting_makers.hpp"

namespace swiftlet {

std::vector<Setting> deviceSettings() {
  using L = ImuLinkGroup;
  using C = CamerasGroup;
  using T = TriggerGroup;
  constexpr auto kVehicle = &Settings::vehicle;
  constexpr auto kLink = &Settings::imu_link;
  constexpr auto kCameras = &Settings::cameras;
  constexpr auto kTrigger = &Settings::trigger;
  constexpr auto kHil = &Settings::hil;
  using A = AutopilotGroup;
  constexpr auto kAutopilot = &Settings::autopilot;
  constexpr auto kRos2 = &Settings::ros2;
  return {
      {"vehicle.calibration", "",
       "Calibration for `fly`, `record` and `doctor`: a folder, or a file from EuRoC, Kalibr, Basalt, ROS "
       "camera_info or OpenCV.",
       TextSetting{member(kVehicle, &VehicleGroup::calibration), "a file or folder name, or empty"}},
      {"vehicle.imu_calibration", "", "IMU calibration file, if it is not next to the camera calibration.",
       TextSetting{member(kVehicle, &VehicleGroup::imu_calibration), "a file name, or empty"}},
      {"imu_link.device", "",
       "Device of the IMU: a serial port (preferably by its name in /dev/serial/by-id), a CAN interface, or "
       "an autopilot's UDP port.",
       TextSetting{member(kLink, &L::device), "/dev/ttyUSB0, can0, udp:127.0.0.1:14580@14540, or empty"}},
      {"imu_link.topic", "",
       "ROS 2 topic of the IMU (sensor_msgs/Imu), used instead of imu_link.device. With accel_topic it is "
       "the gyroscope's topic. Needs a build with SWIFTLET_WITH_DDS; docs/ros2.md.",
       TextSetting{member(kLink, &L::topic), "a topic such as /camera/imu, or empty"}},
      {"imu_link.accel_topic", "",
       "ROS 2 topic of the accelerometer, if it is separate. Its samples are interpolated to the gyroscope's "
       "stamps.",
       TextSetting{member(kLink, &L::accel_topic), "a topic such as /camera/accel/sample, or empty"}},
      {"imu_link.protocol", "",
       "Protocol of the IMU. dronecan needs a CAN interface; mavlink a serial port or UDP; the others a "
       "serial port. bridge is swiftlet's own framing for microcontrollers, docs/serial.md.",
       ChoiceSetting{member(kLink, &L::protocol),
                     {"bridge", "vectornav", "xsens", "mip", "mavlink", "dronecan"}}},
      {"imu_link.baud", "Bd",
       "Baud rate of the serial port. Ignored by USB devices that are not serial adapters.",
       integer(kLink, &L::baud, 1200, 4'000'000)},
      {"imu_link.rate_hz", "Hz",
       "Sample rate of an IMU without calibration. Otherwise the calibration gives the rate.",
       real(kLink, &L::rate_hz, 10, 4000)},
      {"imu_link.delay_ms", "ms",
       "Constant delay between measurement and arrival of a sample, subtracted from every stamp. Clock "
       "synchronization cannot measure it.",
       real(kLink, &L::delay_ms, 0, 100)},
      {"imu_link.can_node", "", "CAN node that sends RawIMU; 0: the first node that is heard.",
       integer(kLink, &L::can_node, 0, 127)},
      {"cameras.device0", "", "Video node of camera 0 (preferably by its name in /dev/v4l/by-path).",
       TextSetting{member(kCameras, &C::device0), "a node such as /dev/video0, or empty"}},
      {"cameras.device1", "", "Video node of camera 1; empty: one camera, or both cameras in one image.",
       TextSetting{member(kCameras, &C::device1), "a node such as /dev/video2, or empty"}},
      {"cameras.pipeline0", "",
       "GStreamer pipeline of camera 0, used instead of device0: gst-launch-1.0 syntax without a sink. Needs "
       "a build with SWIFTLET_WITH_GSTREAMER; docs/gstreamer.md.",
       TextSetting{member(kCameras, &C::pipeline0), "a pipeline such as \"libcamerasrc\", or empty"}},
      {"cameras.pipeline1", "", "GStreamer pipeline of camera 1, used instead of device1.",
       TextSetting{member(kCameras, &C::pipeline1), "a pipeline such as \"libcamerasrc\", or empty"}},
      {"cameras.topic0", "",
       "ROS 2 topic of camera 0, used instead of device0: sensor_msgs/Image, or CompressedImage if the name "
       "ends with /compressed. Needs a build with SWIFTLET_WITH_DDS; docs/ros2.md.",
       TextSetting{member(kCameras, &C::topic0), "a topic such as /camera/infra1/image_rect_raw, or empty"}},
      {"cameras.topic1", "", "ROS 2 topic of camera 1, used instead of device1.",
       TextSetting{member(kCameras, &C::topic1), "a topic such as /camera/infra2/image_rect_raw, or empty"}},
      {"cameras.camera_info", "",
       "Use of the CameraInfo that comes with the cameras' topics. check: warn if it differs by more than 1 "
       "px from the calibration; use: replace the calibration's lenses (rectified topics: P without "
       "distortion); off: ignore.",
       ChoiceSetting{member(kCameras, &C::camera_info), {kCameraInfoOff, kCameraInfoCheck, kCameraInfoUse}}},
      {"cameras.side_by_side", "",
       "device0, pipeline0 or topic0 delivers both cameras in one image, camera 0 in the left half. Not "
       "needed for format Y8I.",
       onOff(kCameras, &C::side_by_side)},
      {"cameras.format", "",
       "V4L2 pixel format (fourcc) requested from the video nodes, docs/v4l2.md. any: the first format that "
       "the camera accepts in the calibration's size at rate_hz, MJPG last.",
       TextSetting{member(kCameras, &C::format), "four letters such as GREY or MJPG, or any"}},
      {"cameras.resolution", "",
       "Image size of cameras without calibration, for `record` and `doctor`. These commands use it if "
       "vehicle.calibration is empty.",
       TextSetting{member(kCameras, &C::resolution), "width and height such as 752x480, or empty"}},
      {"cameras.rate_hz", "Hz", "Frame rate requested from each camera.",
       real(kCameras, &C::rate_hz, 1, 500)},
      {"cameras.exposure_ms", "ms",
       "Exposure time that the video nodes are set to, or that a pipeline sets itself. 0: unknown; stamps "
       "are then not moved to mid-exposure unless exposure_control is on.",
       real(kCameras, &C::exposure_ms, 0, 1000)},
      {"cameras.gain", "", "Gain that the video nodes are set to, in the camera's own unit; -1: unchanged.",
       integer(kCameras, &C::gain, -1, 65535)},
      {"cameras.exposure_control", "",
       "Control exposure and gain of all cameras in flight for odometry: bounded motion blur, steady "
       "brightness, the same values for both cameras. exposure_ms and gain are the start values. If false, "
       "exposure_ms and gain stay fixed; without them the cameras' own automatic control is used. "
       "docs/exposure.md.",
       onOff(kCameras, &C::exposure_control)},
      {"cameras.shutter", "",
       "Shutter type, if the calibration does not give it. With a rolling shutter the stamp is that of the "
       "middle row.",
       ChoiceSetting{member(kCameras, &C::shutter), {"global", kRolling}}},
      {"cameras.readout_ms", "ms",
       "Readout time from the first row to the last: of a rolling shutter, and of any camera whose driver "
       "stamps the end of the frame. 0: unknown.",
       real(kCameras, &C::readout_ms, 0, 200)},
      {"trigger.chip", "",
       "GPIO chip that receives the cameras' trigger signal; imu: the IMU reports its edges; empty: the "
       "cameras' "
       "own stamps are used.",
       TextSetting{member(kTrigger, &T::chip), "a chip such as gpiochip0, imu, or empty"}},
      {"trigger.line", "",
       "Line of trigger.chip that carries the trigger signal. Empty: line 0 of a GPIO chip; with chip `imu`, "
       "all "
       "inputs of the IMU.",
       TextSetting{member(kTrigger, &T::line), "a line number or name, or empty"}},
      {"trigger.edge", "", "Edge of the trigger signal at which exposure starts.",
       ChoiceSetting{member(kTrigger, &T::edge), {"rising", "falling"}}},
      {"trigger.delay_us", "us", "Delay from the edge to the start of exposure.",
       real(kTrigger, &T::delay_us, 0, 100'000)},
      {"autopilot.device", "",
       "Port on which the autopilot receives pose, obstacles and health: a serial port, udp:HOST:PORT or "
       "udp:HOST:PORT@OWN_PORT. If the autopilot is also the IMU, set the same port as in imu_link.device: "
       "both use one link.",
       TextSetting{member(kAutopilot, &A::device),
                   "a port such as /dev/ttyS1 or udp:127.0.0.1:14580, or empty"}},
      {"autopilot.baud", "Bd",
       "Baud rate of the autopilot's serial port. 40 poses per second with obstacles need at least 230400.",
       integer(kAutopilot, &A::baud, 1200, 4'000'000)},
      {"autopilot.system", "",
       "MAVLink system id of the vehicle (MAV_SYS_ID in PX4, SYSID_THISMAV in ArduPilot).",
       integer(kAutopilot, &A::system, 1, 255)},
      {"autopilot.rate_hz", "Hz", "Poses sent per second. Autopilots expect 30 to 50.",
       real(kAutopilot, &A::rate_hz, 1, 200)},
      {"autopilot.message", "",
       "MAVLink message that carries the pose. Use vision_position_estimate for autopilots without ODOMETRY.",
       ChoiceSetting{member(kAutopilot, &A::message), {"odometry", "vision_position_estimate"}}},
      {"autopilot.obstacles", "",
       "Also send the distance to the nearest point of the local mesh in 72 sectors.",
       onOff(kAutopilot, &A::obstacles)},
      {"autopilot.roll_deg", "deg",
       "Rotation of the IMU in the vehicle (axes forward, left, up) about forward, applied first. Use 180 "
       "for "
       "an IMU whose z points down: a flight controller's, DroneCAN's, VectorNav's.",
       real(kAutopilot, &A::roll_deg, -180, 180)},
      {"autopilot.pitch_deg", "deg", "Rotation of the IMU in the vehicle about left, applied second.",
       real(kAutopilot, &A::pitch_deg, -180, 180)},
      {"autopilot.yaw_deg", "deg", "Rotation of the IMU in the vehicle about up, applied last.",
       real(kAutopilot, &A::yaw_deg, -180, 180)},
      {"autopilot.arm_x", "m",
       "Position of the vehicle's reference point relative to the IMU, along the IMU's x axis. Leave the "
       "autopilot's own offset at 0.",
       real(kAutopilot, &A::arm_x, -10, 10)},
      {"autopilot.arm_y", "m",
       "Position of the vehicle's reference point relative to the IMU, along the IMU's y axis.",
       real(kAutopilot, &A::arm_y, -10, 10)},
      {"autopilot.arm_z", "m",
       "Position of the vehicle's reference point relative to the IMU, along the IMU's z axis.",
       real(kAutopilot, &A::arm_z, -10, 10)},
      {"ros2.enabled", "",
       "Publish pose, frames, mesh, surface and diagnostics as ROS 2 topics, in flights and `replay "
       "--real-time`. Needs a build with SWIFTLET_WITH_DDS; docs/ros2.md.",
       onOff(kRos2, &Ros2Group::enabled)},
      {"ros2.domain", "", "ROS_DOMAIN_ID of the other ROS 2 processes.",
       integer(kRos2, &Ros2Group::domain, 0, 232)},
      {"ros2.driver", "",
       "ROS 2 driver whose topics provide cameras and IMU if no topics are set, docs/ros2.md.",
       ChoiceSetting{member(kRos2, &Ros2Group::driver), {"none", "realsense", "depthai", "zed"}}},
      {"ros2.interface", "", "Network interface of the topics; lo: this computer only.",
       TextSetting{member(kRos2, &Ros2Group::interface), "an interface such as lo or eth0"}},
      {"ros2.odometry_hz", "Hz", "Maximum rate of published states.",
       real(kRos2, &Ros2Group::odometry_hz, 1, 1000)},
      {"ros2.mesh_hz", "Hz", "Maximum rate of published local meshes.",
       real(kRos2, &Ros2Group::mesh_hz, 0.1, 50)},
      {"ros2.label_topic", "",
       "Topic on which a network sends label images for the map (sensor_msgs/Image, mono8) in answer to "
       "/swiftlet/mapped_image; empty: none.",
       TextSetting{member(kRos2, &Ros2Group::label_topic), "a topic such as /segmentation/labels, or empty"}},
      {"ros2.label_patience", "s",
       "Longest wait of the map for an image's labels. After it the image is mapped without labels.",
       real(kRos2, &Ros2Group::label_patience, 0.01, 10)},
      {"hil.output0", "", "For `hil`: video output node that feeds camera 0 (of the vivid driver).",
       TextSetting{member(kHil, &HilGroup::output0), "a node such as /dev/video10, or empty"}},
      {"hil.output1", "",
       "For `hil`: video output node that feeds camera 1. Needed if the log has this camera.",
       TextSetting{member(kHil, &HilGroup::output1), "a node such as /dev/video11, or empty"}},
      {"hil.trigger_pull", "",
       "For `hil`: file that sets the level of the trigger line (of gpio-sim); empty: no trigger.",
       TextSetting{member(kHil, &HilGroup::trigger_pull), "a file such as .../sim_gpio3/pull, or empty"}},
  };
}

}  // namespace swiftlet
