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
       "Calibration of the rig for `fly`, `record` and `doctor`: a folder, or a file of EuRoC, Kalibr, "
       "Basalt, "
       "ROS camera_info or OpenCV.",
       TextSetting{member(kVehicle, &VehicleGroup::calibration), "a file's or folder's name, or empty"}},
      {"vehicle.imu_calibration", "", "IMU file where it is not beside the cameras' file.",
       TextSetting{member(kVehicle, &VehicleGroup::imu_calibration), "a file's name, or empty"}},
      {"imu_link.device", "",
       "Serial port (best by its name under /dev/serial/by-id), CAN interface or an autopilot's UDP port.",
       TextSetting{member(kLink, &L::device), "/dev/ttyUSB0, can0, udp:127.0.0.1:14580@14540, or empty"}},
      {"imu_link.topic", "",
       "ROS 2 topic of the IMU (sensor_msgs/Imu) in place of imu_link.device, docs/ros2.md; of the gyroscope "
       "where accel_topic is named too; for builds with SWIFTLET_WITH_DDS.",
       TextSetting{member(kLink, &L::topic), "a topic as /camera/imu, or empty"}},
      {"imu_link.accel_topic", "",
       "ROS 2 topic of the accelerometer where it is apart: interpolated to the gyroscope's stamps.",
       TextSetting{member(kLink, &L::accel_topic), "a topic as /camera/accel/sample, or empty"}},
      {"imu_link.protocol", "",
       "What the IMU speaks; dronecan is on a CAN interface, the others on a serial port, mavlink also on "
       "UDP. bridge: the project's own framing for microcontrollers, docs/serial.md.",
       ChoiceSetting{member(kLink, &L::protocol),
                     {"bridge", "vectornav", "xsens", "mip", "mavlink", "dronecan"}}},
      {"imu_link.baud", "Bd", "Rate of the serial port; means nothing on USB that is no adapter.",
       integer(kLink, &L::baud, 1200, 4'000'000)},
      {"imu_link.rate_hz", "Hz",
       "Samples per second of an IMU that has no calibration yet; else its own says it.",
       real(kLink, &L::rate_hz, 10, 4000)},
      {"imu_link.delay_ms", "ms",
       "Constant part of the way from sensing to arrival, which no clock comparison can see; taken off every "
       "sample's stamp.",
       real(kLink, &L::delay_ms, 0, 100)},
      {"imu_link.can_node", "", "Node whose RawIMU is taken; 0: the first that is heard.",
       integer(kLink, &L::can_node, 0, 127)},
      {"cameras.device0", "", "Video node of camera 0 (best by its name under /dev/v4l/by-path).",
       TextSetting{member(kCameras, &C::device0), "a node as /dev/video0, or empty"}},
      {"cameras.device1", "", "Video node of camera 1; empty: one camera, or both in one image.",
       TextSetting{member(kCameras, &C::device1), "a node as /dev/video2, or empty"}},
      {"cameras.pipeline0", "",
       "GStreamer pipeline of camera 0 in place of device0, as gst-launch-1.0 takes it, without a sink, "
       "docs/gstreamer.md; for builds with SWIFTLET_WITH_GSTREAMER.",
       TextSetting{member(kCameras, &C::pipeline0), "a pipeline as \"libcamerasrc\", or empty"}},
      {"cameras.pipeline1", "", "GStreamer pipeline of camera 1 in place of device1.",
       TextSetting{member(kCameras, &C::pipeline1), "a pipeline as \"libcamerasrc\", or empty"}},
      {"cameras.topic0", "",
       "ROS 2 topic of camera 0 in place of device0, docs/ros2.md: sensor_msgs/Image, or CompressedImage "
       "where "
       "its name ends with /compressed; for builds with SWIFTLET_WITH_DDS.",
       TextSetting{member(kCameras, &C::topic0), "a topic as /camera/infra1/image_rect_raw, or empty"}},
      {"cameras.topic1", "", "ROS 2 topic of camera 1 in place of device1.",
       TextSetting{member(kCameras, &C::topic1), "a topic as /camera/infra2/image_rect_raw, or empty"}},
      {"cameras.camera_info", "",
       "What CameraInfo beside the cameras' topics is for. check: compared with the calibration's lenses, "
       "more "
       "than 1 px of difference is a warning; use: taken in their place, for rectified topics its P without "
       "distortion; off: nothing.",
       ChoiceSetting{member(kCameras, &C::camera_info), {kCameraInfoOff, kCameraInfoCheck, kCameraInfoUse}}},
      {"cameras.side_by_side", "",
       "device0, pipeline0 or topic0 gives both cameras in one image, camera 0 in its left half. Format Y8I, "
       "pixel "
       "beside pixel, needs no such word.",
       onOff(kCameras, &C::side_by_side)},
      {"cameras.format", "",
       "Pixels that the video nodes are asked for, by V4L2's four letters, docs/v4l2.md; any: the first that "
       "is taken and comes in the calibration's size at rate_hz, MJPG last.",
       TextSetting{member(kCameras, &C::format), "four letters as GREY or MJPG, or any"}},
      {"cameras.resolution", "",
       "Size of the images of cameras that have no calibration yet, for record and doctor: without "
       "vehicle.calibration they take the rig as it is.",
       TextSetting{member(kCameras, &C::resolution), "width and height as 752x480, or empty"}},
      {"cameras.rate_hz", "Hz", "Images per second that each camera is asked for.",
       real(kCameras, &C::rate_hz, 1, 500)},
      {"cameras.exposure_ms", "ms",
       "Exposure that the video nodes are set to, or that pipelines set themselves; 0: not known, and stamps "
       "are not moved to its middle unless exposure_control is on.",
       real(kCameras, &C::exposure_ms, 0, 1000)},
      {"cameras.gain", "", "Gain of the video nodes in the cameras' own units; -1: as they have it.",
       integer(kCameras, &C::gain, -1, 65535)},
      {"cameras.exposure_control", "",
       "Adjust exposure and gain of all cameras in flight, as odometry needs it: bounded motion blur, steady "
       "brightness, one setting for both. exposure_ms and gain are where it begins. If false, they stay, and "
       "without them the cameras' own automatics act. docs/exposure.md.",
       onOff(kCameras, &C::exposure_control)},
      {"cameras.shutter", "",
       "Where the calibration does not say it. A rolling shutter's stamp is that of its middle row.",
       ChoiceSetting{member(kCameras, &C::shutter), {"global", kRolling}}},
      {"cameras.readout_ms", "ms", "From the first row to the last.", real(kCameras, &C::readout_ms, 0, 100)},
      {"trigger.chip", "", "GPIO chip that sees the cameras' trigger; empty: the cameras' own stamps.",
       TextSetting{member(kTrigger, &T::chip), "a chip as gpiochip0, or empty"}},
      {"trigger.line", "", "Line of that chip that the cameras' trigger is on.",
       TextSetting{member(kTrigger, &T::line), "its number or its name"}},
      {"trigger.edge", "", "Edge at which exposure begins.",
       ChoiceSetting{member(kTrigger, &T::edge), {"rising", "falling"}}},
      {"trigger.delay_us", "us", "From the edge to the begin of exposure.",
       real(kTrigger, &T::delay_us, 0, 100'000)},
      {"autopilot.device", "",
       "Where the autopilot is told of pose, obstacles and health: a serial port, udp:HOST:PORT or "
       "udp:HOST:PORT@OWN_PORT. The same as imu_link.device where the autopilot is the IMU: one link.",
       TextSetting{member(kAutopilot, &A::device), "a port as /dev/ttyS1, udp:127.0.0.1:14580, or empty"}},
      {"autopilot.baud", "Bd",
       "Rate of the autopilot's serial port; 40 poses a second with obstacles want 230400 at least.",
       integer(kAutopilot, &A::baud, 1200, 4'000'000)},
      {"autopilot.system", "", "MAVLink system of the vehicle (PX4's MAV_SYS_ID, ArduPilot's SYSID_THISMAV).",
       integer(kAutopilot, &A::system, 1, 255)},
      {"autopilot.rate_hz", "Hz", "Poses per second; autopilots ask for 30 to 50.",
       real(kAutopilot, &A::rate_hz, 1, 200)},
      {"autopilot.message", "",
       "What poses are told by; vision_position_estimate is for autopilots without ODOMETRY.",
       ChoiceSetting{member(kAutopilot, &A::message), {"odometry", "vision_position_estimate"}}},
      {"autopilot.obstacles", "", "Also tell the distance to the nearest of the local mesh in 72 sectors.",
       onOff(kAutopilot, &A::obstacles)},
      {"autopilot.roll_deg", "deg",
       "How the IMU is turned in the vehicle, whose axes are forward, left, up: about forward, applied "
       "first.",
       real(kAutopilot, &A::roll_deg, -180, 180)},
      {"autopilot.pitch_deg", "deg", "Likewise about left, applied second.",
       real(kAutopilot, &A::pitch_deg, -180, 180)},
      {"autopilot.yaw_deg", "deg", "Likewise about up, applied last.",
       real(kAutopilot, &A::yaw_deg, -180, 180)},
      {"autopilot.arm_x", "m",
       "From the IMU to the vehicle's reference point, in the IMU's axes; the autopilot's own offset stays "
       "0.",
       real(kAutopilot, &A::arm_x, -10, 10)},
      {"autopilot.arm_y", "m", "Likewise along the IMU's second axis.", real(kAutopilot, &A::arm_y, -10, 10)},
      {"autopilot.arm_z", "m", "Likewise along the IMU's third axis.", real(kAutopilot, &A::arm_z, -10, 10)},
      {"ros2.enabled", "",
       "Publish pose, frames, mesh, surface and diagnostics of runs on threads as ROS 2's topics, "
       "docs/ros2.md; "
       "for builds with SWIFTLET_WITH_DDS.",
       onOff(kRos2, &Ros2Group::enabled)},
      {"ros2.domain", "", "The ROS_DOMAIN_ID of those who listen and send.",
       integer(kRos2, &Ros2Group::domain, 0, 232)},
      {"ros2.driver", "",
       "Driver whose topics are the cameras and the IMU where the settings name none of their own, "
       "docs/ros2.md.",
       ChoiceSetting{member(kRos2, &Ros2Group::driver), {"none", "realsense", "depthai", "zed"}}},
      {"ros2.interface", "", "Network interface of the topics; lo: this computer alone.",
       TextSetting{member(kRos2, &Ros2Group::interface), "an interface as lo or eth0"}},
      {"ros2.odometry_hz", "Hz", "Most states per second that are published.",
       real(kRos2, &Ros2Group::odometry_hz, 1, 1000)},
      {"ros2.mesh_hz", "Hz", "Most local meshes per second that are published.",
       real(kRos2, &Ros2Group::mesh_hz, 0.1, 50)},
      {"ros2.label_topic", "",
       "Topic of label images for the map (sensor_msgs/Image, mono8), which a network answers "
       "/swiftlet/mapped_image with; empty: none.",
       TextSetting{member(kRos2, &Ros2Group::label_topic), "a topic as /segmentation/labels, or empty"}},
      {"ros2.label_patience", "s", "How long the map waits for an image's labels before it does without.",
       real(kRos2, &Ros2Group::label_patience, 0.01, 10)},
      {"hil.output0", "",
       "For `hil`: video output node whose images camera 0 shows (vivid's); empty: none are shown.",
       TextSetting{member(kHil, &HilGroup::output0), "a node as /dev/video10, or empty"}},
      {"hil.output1", "", "Likewise for camera 1.",
       TextSetting{member(kHil, &HilGroup::output1), "a node as /dev/video11, or empty"}},
      {"hil.trigger_pull", "",
       "For `hil`: the file that pulls the trigger's line up and down (gpio-sim's); empty: none is pulled.",
       TextSetting{member(kHil, &HilGroup::trigger_pull), "a file as .../sim_gpio3/pull, or empty"}},
  };
}

}  // namespace swiftlet
