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
  std::string imu;    ///< or of the gyroscope
  std::string accel;  ///< empty: `imu` has both

  [[nodiscard]] bool any() const { return !imu.empty() || !camera[0].empty() || !camera[1].empty(); }
};

/// What the settings name, and for what they do not name at all the topics of ros2.driver. `cameras`: of the
/// rig.
[[nodiscard]] InputTopics inputTopics(const Settings& settings, std::size_t cameras = kMaxCameras);

/// Of ros2.domain and ros2.interface; the library's complaints go to the console.
[[nodiscard]] DdsNetwork inputNetwork(const Settings& settings);

/// A line for each topic of images, inertial samples and calibrations that somebody publishes there, after
/// listening for some seconds.
void addTopics(const Settings& settings, MachineReport& report);

/// "/camera/infra1/camera_info" of "/camera/infra1/image_rect_raw" and of its compressed kind.
[[nodiscard]] std::string cameraInfoTopic(std::string_view image_topic);

/// Whether the images of a topic are rectified: by a word `rect` in its name, as ROS's drivers have it.
[[nodiscard]] bool isRectified(std::string_view image_topic);

/// Largest distance between the two images of one bearing [px], over all that `a` sees.
[[nodiscard]] double largestDifference(const CameraModel& a, const CameraModel& b);

/// For cameras behind topics, according to cameras.camera_info: compares the calibration's lenses with those
/// in CameraInfo and warns above one pixel, or uses the latter. Waits for CameraInfo for up to some seconds.
/// InputError naming cameras.camera_info if lenses are to be used but do not arrive.
void applyCameraInfo(const Settings& settings, Calibration& calibration);

}  // namespace swiftlet
