#pragma once
// The ROS 2 topics that the settings name as cameras and IMU, including a driver's preset, and the lenses
// published with them.

#include <array>
#include <string>
#include <string_view>

#include "drivers/calibration/calibration.hpp"
#include "drivers/dds/dds_domain.hpp"
#include "estimator/camera/camera_model.hpp"
#include "firmware_host/realtime/machine_report.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct InputTopics {
  std::array<std::string, kMaxCameras> camera;
  std::string imu;    ///< or the gyroscope's topic
  std::string accel;  ///< empty: `imu` carries both

  [[nodiscard]] bool any() const { return !imu.empty() || !camera[0].empty() || !camera[1].empty(); }
};

/// The topics in the settings. For a camera or IMU that the settings do not name at all, the topics of
/// ros2.driver. `cameras`: number in the rig.
[[nodiscard]] InputTopics inputTopics(const Settings& settings, std::size_t cameras = kMaxCameras);

/// Network of ros2.domain and ros2.interface; the library's messages go to the console.
[[nodiscard]] DdsNetwork inputNetwork(const Settings& settings);

/// Listens for some seconds and adds a line for each published topic of images, inertial samples or
/// calibrations.
void addTopics(const Settings& settings, MachineReport& report);

/// "/camera/infra1/camera_info" for "/camera/infra1/image_rect_raw" and for its compressed variant.
[[nodiscard]] std::string cameraInfoTopic(std::string_view image_topic);

/// Whether the images of a topic are rectified: its name contains the word `rect`, as in ROS drivers.
[[nodiscard]] bool isRectified(std::string_view image_topic);

/// Largest distance between the two cameras' pixels of one bearing [px], over the whole image of `a`.
[[nodiscard]] double largestDifference(const CameraModel& a, const CameraModel& b);

/// For cameras behind topics, according to cameras.camera_info: compares the calibration's lenses with those
/// in CameraInfo and warns above one pixel, or uses the latter. Waits for CameraInfo for up to some seconds.
/// InputError naming cameras.camera_info if lenses are to be used but do not arrive.
void applyCameraInfo(const Settings& settings, Calibration& calibration);

}  // namespace swiftlet
