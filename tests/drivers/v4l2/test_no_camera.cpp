#include <catch2/catch.hpp>

#include <string>

#include "drivers/v4l2/camera_device.hpp"
#include "drivers/v4l2/camera_offers.hpp"
#include "drivers/v4l2/video_output.hpp"

namespace swiftlet {
namespace {

DeviceFault faultOf(const char* path) {
  CameraDevice camera;
  CameraDeviceSettings settings;
  settings.setPath(path);
  const DeviceFault fault = camera.open(settings);
  CHECK(!camera.isOpen());
  CapturedFrame frame;
  CHECK(camera.next(frame).kind == DeviceFaultKind::kUnplugged);
  CHECK(!frame.valid());
  CHECK(camera.open().kind == fault.kind);
  return fault;
}

TEST_CASE("A camera that is not there, and things that are none, are told apart", "[v4l2]") {
  const DeviceFault missing = faultOf("/dev/no_such_camera");
  CHECK(missing.kind == DeviceFaultKind::kMissing);
  CHECK(missing.text().find("/dev/no_such_camera") != std::string::npos);
  const DeviceFault other = faultOf("/dev/null");
  CHECK(other.kind == DeviceFaultKind::kWrongDevice);
  CHECK(other.text().find("not a video node") != std::string::npos);
  CHECK(faultOf("").kind == DeviceFaultKind::kMissing);
}

TEST_CASE("An output that is not there says so, and takes nothing", "[v4l2]") {
  VideoOutput output;
  CHECK(output.open("/dev/no_such_output", 8, 8).kind == DeviceFaultKind::kMissing);
  CHECK(output.write({}).kind == DeviceFaultKind::kUnplugged);
  CHECK(!output.canWrite());
}

TEST_CASE("Cameras are listed where there are any, without a fault where there are none", "[v4l2]") {
  for (const CameraListing& camera : listCameras()) CHECK(camera.path.find("/dev/video") == 0);
}

}  // namespace
}  // namespace swiftlet
