// Which topics the settings name, what is refused of them, and lenses beside each other.

#include <catch2/catch.hpp>
#include <string>

#include "firmware_host/inputs/devices/input_topics.hpp"
#include "firmware_host/inputs/devices/live_input.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

Calibration euroc() { return readCalibration(SWIFTLET_TEST_DATA "/euroc_mh01_4s"); }

Settings topicSettings() {
  Settings settings;
  settings.cameras.topic0 = "/left/image_raw";
  settings.cameras.topic1 = "/right/image_raw";
  settings.imu_link.topic = "/imu";
  return settings;
}

std::string topicRefusal(const Settings& settings) {
  return test::messageOf([&] { const LiveInput input(settings, euroc()); });
}

TEST_CASE("a driver's preset names what the settings do not") {
  Settings settings;
  CHECK_FALSE(inputTopics(settings).any());
  settings.ros2.driver = "realsense";
  InputTopics topics = inputTopics(settings);
  CHECK(topics.camera[1] == "/camera/camera/infra2/image_rect_raw");
  CHECK(topics.imu == "/camera/camera/gyro/sample");
  CHECK(topics.accel == "/camera/camera/accel/sample");
  CHECK(inputTopics(settings, 1).camera[1].empty());
  settings.imu_link.topic = "/camera/camera/imu";
  CHECK(inputTopics(settings).accel.empty());
  settings.cameras.topic0 = "/other/image";
  topics = inputTopics(settings);
  CHECK(topics.camera[0] == "/other/image");
  CHECK(topics.camera[1].empty());
  settings = {};
  settings.ros2.driver = "zed";
  settings.imu_link.device = "/dev/ttyS1";
  settings.cameras.pipeline0 = "libcamerasrc";
  CHECK_FALSE(inputTopics(settings).any());
}

TEST_CASE("topics that contradict other settings are refused by name") {
  CHECK(topicRefusal(topicSettings()).empty());
  Settings settings = topicSettings();
  settings.cameras.device0 = "/dev/video0";
  CHECK_THAT(topicRefusal(settings), Catch::Contains("cameras.topic0") && Catch::Contains("cameras.device0"));
  settings = topicSettings();
  settings.cameras.pipeline1 = "libcamerasrc";
  CHECK_THAT(topicRefusal(settings),
             Catch::Contains("cameras.topic1") && Catch::Contains("cameras.pipeline1"));
  settings = topicSettings();
  settings.cameras.topic1 = "";
  CHECK_THAT(topicRefusal(settings), Catch::Contains("two cameras, the settings have one"));
  settings = topicSettings();
  settings.imu_link.device = "/dev/ttyS1";
  CHECK_THAT(topicRefusal(settings),
             Catch::Contains("imu_link.topic") && Catch::Contains("cannot be combined"));
  settings = topicSettings();
  settings.imu_link.topic = "";
  CHECK_THAT(topicRefusal(settings), Catch::Contains("no IMU is set"));
  settings.imu_link.accel_topic = "/accel";
  CHECK_THAT(topicRefusal(settings), Catch::Contains("imu_link.accel_topic"));
  settings = topicSettings();
  settings.trigger.chip = "imu";
  CHECK_THAT(topicRefusal(settings), Catch::Contains("topics do not carry trigger edges"));
  settings = topicSettings();
  settings.cameras.gain = 3;
  CHECK_THAT(topicRefusal(settings), Catch::Contains("cameras.gain"));
}

TEST_CASE("CameraInfo stands beside the images, which say by their name what they are") {
  CHECK(cameraInfoTopic("/camera/infra1/image_rect_raw") == "/camera/infra1/camera_info");
  CHECK(cameraInfoTopic("/oak/left/image_raw/compressed") == "/oak/left/camera_info");
  for (const char* name : {"/camera/infra1/image_rect_raw", "/zed/left/gray/rect/image", "/l/image_rect",
                           "/left_gray/image_rect_gray", "/rect"}) {
    CHECK(isRectified(name));
  }
  for (const char* name : {"/oak/left/image_raw", "/direct/image", "/rectangle/image", "/correct"}) {
    CHECK_FALSE(isRectified(name));
  }
}

TEST_CASE("lenses are compared over the whole image") {
  const CameraModel lens = euroc().rig.camera[0];
  CHECK(largestDifference(lens, lens) < 1e-6);
  Eigen::Vector4d intrinsics = lens.intrinsics();
  intrinsics[2] += 2;
  const CameraModel moved(lens.kind(), lens.width(), lens.height(), intrinsics, lens.distortion());
  CHECK(largestDifference(lens, moved) == Approx(2).epsilon(1e-6));
  const CameraModel straight(lens.kind(), lens.width(), lens.height(), lens.intrinsics(),
                             Eigen::Vector4d::Zero());
  CHECK(largestDifference(lens, straight) > 50);
}

}  // namespace
}  // namespace swiftlet
