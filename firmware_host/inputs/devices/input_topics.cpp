#include "firmware_host/inputs/devices/input_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>

#include "drivers/calibration/camera_info.hpp"
#include "drivers/dds/topic_reader.hpp"
#include "drivers/dds/topic_search.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

struct DriverTopics {
  std::string_view driver;
  std::array<const char*, kMaxCameras> camera;
  const char* imu;
  const char* accel;
};

/// Names in the drivers' launch files; docs/ros2.md lists what must be enabled.
constexpr std::array kDrivers = {
    DriverTopics{"realsense",
                 {"/camera/camera/infra1/image_rect_raw", "/camera/camera/infra2/image_rect_raw"},
                 "/camera/camera/gyro/sample",
                 "/camera/camera/accel/sample"},
    DriverTopics{"depthai", {"/oak/left/image_raw", "/oak/right/image_raw"}, "/oak/imu/data", ""},
    DriverTopics{"zed",
                 {"/zed/zed_node/left/gray/rect/image", "/zed/zed_node/right/gray/rect/image"},
                 "/zed/zed_node/imu/data",
                 ""},
};

/// CameraInfo is published with every image; discovery takes some tenths of a second.
constexpr Duration kInfoPatience = Duration::fromMilliseconds(3000);
constexpr double kMostApart = 1;  // px
/// A participant announces itself as soon as another appears; image traffic on a busy computer delays this.
constexpr Duration kHearsay = Duration::fromMilliseconds(1500);

/// Empty: none arrived; `why` lists what is there.
std::optional<CameraInfo> receiveInfo(const Settings& settings, const std::string& topic, std::string& why) {
  const std::shared_ptr<DdsDomain> domain = DdsDomain::open(inputNetwork(settings), why);
  TopicBell bell;
  TopicReader reader;
  if (!domain || !reader.open(domain, TopicType::kCameraInfo, topic, bell, why)) return std::nullopt;
  CameraInfo info;
  const Stamp end = monotonicNow() + kInfoPatience;
  for (Stamp now = monotonicNow(); now < end; now = monotonicNow()) {
    bell.clear();
    if (reader.take(info)) return info;
    bell.wait(end - now);
  }
  why = missingTopic(domain->publishedTopics(), rosName(TopicType::kCameraInfo), topic);
  if (reader.publishers() > 0) why = "no message on " + topic;
  return std::nullopt;
}

}  // namespace

InputTopics inputTopics(const Settings& settings, std::size_t cameras) {
  const CamerasGroup& group = settings.cameras;
  InputTopics topics{{group.topic0, group.topic1}, settings.imu_link.topic, settings.imu_link.accel_topic};
  const auto* driver = std::ranges::find(kDrivers, settings.ros2.driver, &DriverTopics::driver);
  if (driver == kDrivers.end()) return topics;
  const bool names_camera = !topics.camera[0].empty() || !topics.camera[1].empty();
  if (!names_camera && group.device0.empty() && group.pipeline0.empty()) {
    for (std::size_t i = 0; i < cameras; ++i) topics.camera.at(i) = driver->camera.at(i);
  }
  if (topics.imu.empty() && settings.imu_link.device.empty()) {
    topics.imu = driver->imu;
    topics.accel = driver->accel;
  }
  return topics;
}

DdsNetwork inputNetwork(const Settings& settings) {
  DdsNetwork network;
  network.domain = static_cast<std::uint32_t>(settings.ros2.domain);
  network.interface = settings.ros2.interface;
  network.complain = [](std::string_view line) { warn("dds: " + std::string(line)); };
  return network;
}

void addTopics(const Settings& settings, MachineReport& report) {
  std::string error;
  const std::shared_ptr<DdsDomain> domain = DdsDomain::open(inputNetwork(settings), error);
  if (!domain) {
    report.lines.push_back({"topic", error, MachineVerdict::kPoor, "set ros2.interface and ros2.domain"});
    return;
  }
  sleepFor(kHearsay);
  bool any = false;
  for (const PublishedTopic& topic : domain->publishedTopics()) {
    constexpr std::array kTypes = {TopicType::kImage, TopicType::kCompressedImage, TopicType::kImu,
                                   TopicType::kCameraInfo};
    if (std::ranges::none_of(kTypes, [&](TopicType type) { return topic.type == rosName(type); })) continue;
    any = true;
    report.lines.push_back({"topic", topic.name + " " + topic.type, MachineVerdict::kGood, ""});
  }
  if (any) return;
  report.lines.push_back(
      {"topic", fmt::format("none in domain {} on {}", settings.ros2.domain, settings.ros2.interface),
       MachineVerdict::kNote,
       "start the driver; on lo it must run on this computer (ROS_LOCALHOST_ONLY=1) with ROS_DOMAIN_ID equal "
       "to ros2.domain"});
}

std::string cameraInfoTopic(std::string_view image_topic) {
  constexpr std::string_view kCompressed = "/compressed";
  if (image_topic.ends_with(kCompressed)) image_topic.remove_suffix(kCompressed.size());
  return std::string(image_topic.substr(0, image_topic.rfind('/'))) + "/camera_info";
}

bool isRectified(std::string_view image_topic) {
  constexpr std::string_view kWord = "rect";
  const auto letter = [&](std::size_t at) {
    return at < image_topic.size() && std::isalpha(static_cast<unsigned char>(image_topic[at])) != 0;
  };
  for (std::size_t at = image_topic.find(kWord); at != std::string_view::npos;
       at = image_topic.find(kWord, at + 1)) {
    if ((at == 0 || !letter(at - 1)) && !letter(at + kWord.size())) return true;
  }
  return false;
}

double largestDifference(const CameraModel& a, const CameraModel& b) {
  constexpr int kCells = 24;
  double largest = 0;
  for (int row = 0; row <= kCells; ++row) {
    for (int column = 0; column <= kCells; ++column) {
      const Eigen::Vector2d pixel(static_cast<double>(column) * (a.width() - 1) / kCells,
                                  static_cast<double>(row) * (a.height() - 1) / kCells);
      Eigen::Vector3d bearing;
      Eigen::Vector2d other;
      if (!a.unproject(pixel, bearing)) continue;
      // A point outside of `b`'s view counts as farther away than any image width.
      const bool seen = b.project(bearing, other);
      largest = std::max(largest, seen ? (other - pixel).norm() : static_cast<double>(a.width()));
    }
  }
  return largest;
}

void applyCameraInfo(const Settings& settings, Calibration& calibration) {
  const CamerasGroup& group = settings.cameras;
  if (group.camera_info == kCameraInfoOff || group.side_by_side) return;
  const bool uses = group.camera_info == kCameraInfoUse;
  Rig& rig = calibration.rig;
  const InputTopics topics = inputTopics(settings, rig.camera_count);
  for (std::size_t i = 0; i < rig.camera_count; ++i) {
    const std::string& image = topics.camera.at(i);
    if (image.empty()) continue;
    const std::string topic = cameraInfoTopic(image);
    const auto failed = [&](const std::string& why, const std::string& remedy) {
      if (uses) throw InputError("settings", 0, "cameras.camera_info", why, remedy);
      calibration.warnings.push_back(fmt::format("camera {}: lens not checked: {}", i, why));
    };
    std::string why;
    const std::optional<CameraInfo> info = receiveInfo(settings, topic, why);
    if (!info) {
      failed(why, "Enable CameraInfo in the driver, or set cameras.camera_info to off");
      continue;
    }
    CameraModel told;
    try {
      told = isRectified(image) ? rectifiedLens(*info, topic, calibration.warnings)
                                : rawLens(*info, topic, calibration.warnings);
    } catch (const InputError& error) {
      if (uses) throw;
      failed(error.what(), "");
      continue;
    }
    CameraModel& lens = rig.camera.at(i);
    if (told.width() != lens.width() || told.height() != lens.height()) {
      failed(fmt::format("{} is for {}x{}, the calibration for {}x{}", topic, told.width(), told.height(),
                         lens.width(), lens.height()),
             "Give the calibration of these images");
      continue;
    }
    const double apart = largestDifference(lens, told);
    if (uses) {
      lens = told;
    } else if (apart > kMostApart) {
      calibration.warnings.push_back(
          fmt::format("camera {}: the calibration's lens and {} differ by up to {:.1f} px{}; recalibrate, or "
                      "set cameras.camera_info to use",
                      i, topic, apart, isRectified(image) ? " (the images are rectified)" : ""));
    }
  }
}

}  // namespace swiftlet
