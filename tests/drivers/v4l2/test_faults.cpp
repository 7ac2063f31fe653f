// What goes wrong with a camera, made to go wrong by the kernel's test camera; inside the sandbox.
#include <catch2/catch.hpp>

#include <cstdio>
#include <string>

#include "drivers/v4l2/camera_device.hpp"
#include "tests/drivers/recorded/recording_allocations.hpp"
#include "tests/drivers/v4l2/stream.hpp"
#include "tests/drivers/v4l2/vivid.hpp"
#include "tests/support/sandbox.hpp"

namespace swiftlet {
namespace {

std::string path() { return sandbox::device("SANDBOX_CAMERA0"); }

void openCamera(CameraDevice& camera) {
  vivid::set(path(), "Timestamp Source", 1);
  const DeviceFault fault = camera.open(stream::settings(path()));
  INFO(describe(fault, path()));
  REQUIRE(fault.ok());
}

std::uint64_t take(CameraDevice& camera, int count) {
  CapturedFrame frame;
  std::uint64_t last = 0;
  for (int got = 0, tries = 0; got < count; ++tries) {
    REQUIRE(tries < 10 * count);
    REQUIRE(stream::wait(camera, frame).ok());
    if (!frame.valid()) continue;
    ++got;
    REQUIRE(frame.sequence > last);
    last = frame.sequence;
  }
  return last;
}

/// The fault that ends the stream, within a second; the camera is closed then.
DeviceFault endOf(CameraDevice& camera) {
  CapturedFrame frame;
  DeviceFault fault;
  for (int i = 0; i < 50 && fault.ok(); ++i) fault = stream::wait(camera, frame, 100);
  CHECK(!frame.valid());
  CHECK(!camera.isOpen());
  CHECK(camera.fd() < 0);
  std::printf("%s\n", describe(fault, "camera 0 (" + path() + ")").c_str());
  return fault;
}

/// Tries as a user of the device would, a few times a second.
bool comesBack(CameraDevice& camera) {
  for (int i = 0; i < 40; ++i) {
    if (camera.open().ok()) return true;
    ::poll(nullptr, 0, 100);
  }
  return false;
}

TEST_CASE("Dropped buffers are holes in the sequence, each counted", "[faults]") {
  CameraDevice camera;
  openCamera(camera);
  vivid::set(path(), "Percentage of Dropped Buffers", 30);
  const std::uint64_t last = take(camera, 100);
  vivid::set(path(), "Percentage of Dropped Buffers", 0);
  const CameraCounters& counters = camera.counters();
  CHECK(counters.frames == 100);
  CHECK(counters.missed >= 10);
  CHECK(counters.frames + counters.missed == last);
}

TEST_CASE("A damaged frame is put back unseen, and the next one comes", "[faults]") {
  CameraDevice camera;
  openCamera(camera);
  take(camera, 2);
  vivid::set(path(), "Inject V4L2_BUF_FLAG_ERROR", 1);
  take(camera, 5);
  CHECK(camera.counters().damaged == 1);
  CHECK(camera.counters().missed == 0);
  CHECK(camera.counters().requeue_failed == 0);
}

TEST_CASE("A sequence number that wraps is no hole", "[faults]") {
  CameraDevice camera;
  vivid::set(path(), "Wrap Sequence Number", 1);
  openCamera(camera);
  take(camera, 200);
  vivid::set(path(), "Wrap Sequence Number", 0);
  CHECK(camera.counters().missed == 0);
}

TEST_CASE("The driver's word on what its stamps mark is passed on", "[faults]") {
  vivid::set(path(), "Timestamp Source", 0);
  CameraDevice camera;
  REQUIRE(camera.open(stream::settings(path())).ok());
  CHECK(camera.facts().event == StampEvent::kEndOfFrame);
  CapturedFrame frame;
  REQUIRE(stream::wait(camera, frame).ok());
  REQUIRE(frame.valid());
  CHECK(frame.event == StampEvent::kEndOfFrame);
  // This driver's end of frame is start + 0.9 periods, after it handed the frame over.
  CHECK(camera.counters().stamp_ahead == 1);
  camera.close();
  vivid::set(path(), "Timestamp Source", 1);
}

TEST_CASE("A camera that is unplugged is reported, and taken up when it is back", "[faults]") {
  const std::size_t files = sandbox::openFiles();
  {
    CameraDevice camera;
    openCamera(camera);
    const std::uint64_t before = take(camera, 3);
    vivid::set(path(), "Disconnect", 1);
    const DeviceFault fault = endOf(camera);
    CHECK(fault.kind == DeviceFaultKind::kUnplugged);
    REQUIRE(comesBack(camera));
    CHECK(take(camera, 5) > before);
    CHECK(camera.counters().reopened == 1);
    CHECK(camera.facts().rate == Approx(20));
  }
  CHECK(sandbox::openFiles() == files);
  CHECK(sandbox::mappings("/dev/video") == 0);
}

TEST_CASE("A frame that was lent out when its camera went is let go without harm", "[faults]") {
  CameraDevice camera;
  openCamera(camera);
  CapturedFrame kept;
  REQUIRE(stream::wait(camera, kept).ok());
  REQUIRE(kept.valid());
  vivid::set(path(), "Disconnect", 1);
  endOf(camera);
  REQUIRE(comesBack(camera));
  kept.release();
  take(camera, 10);
  CHECK(camera.counters().requeue_failed == 0);
  CHECK(camera.counters().missed == 0);
}

TEST_CASE("A stream that fails for good is reported, and begun anew", "[faults]") {
  CameraDevice camera;
  openCamera(camera);
  take(camera, 2);
  vivid::set(path(), "Inject Fatal Streaming Error", 1);
  const DeviceFault fault = endOf(camera);
  CHECK(fault.kind == DeviceFaultKind::kFailed);
  REQUIRE(comesBack(camera));
  take(camera, 5);
}

TEST_CASE("Calls that the driver refuses once make a fault, and the next try succeeds", "[faults]") {
  for (const char* control :
       {"Inject VIDIOC_REQBUFS Error", "Inject VIDIOC_QBUF Error", "Inject VIDIOC_STREAMON Error"}) {
    INFO(control);
    const std::size_t files = sandbox::openFiles();
    CameraDevice camera;
    vivid::set(path(), control, 1);
    const DeviceFault fault = camera.open(stream::settings(path()));
    std::printf("%s\n", describe(fault, "camera 0 (" + path() + ")").c_str());
    CHECK(fault.kind == DeviceFaultKind::kFailed);
    CHECK(!camera.isOpen());
    CHECK(sandbox::openFiles() == files);
    REQUIRE(camera.open().ok());
    take(camera, 2);
  }
  CHECK(sandbox::mappings("/dev/video") == 0);
}

TEST_CASE("All nodes go and come again with the driver", "[faults]") {
  const std::string driver = "/sys/bus/platform/drivers/vivid/";
  CameraDevice camera;
  openCamera(camera);
  take(camera, 3);
  vivid::write(driver + "unbind", "vivid.0");
  const DeviceFault fault = endOf(camera);
  CHECK(fault.kind == DeviceFaultKind::kUnplugged);
  CHECK(camera.open().kind == DeviceFaultKind::kMissing);
  CHECK(camera.open().text().find(path()) != std::string::npos);
  vivid::write(driver + "bind", "vivid.0");
  REQUIRE(vivid::waitForNode(path(), 5000));
  REQUIRE(comesBack(camera));
  take(camera, 5);
  CHECK(camera.counters().reopened == 1);
}

TEST_CASE("Opening, capturing, failing and coming back allocate nothing", "[faults]") {
  CameraDeviceSettings settings = stream::settings(path());
  settings.gain = 5000;  // warned of
  CameraDeviceSettings refused = stream::settings(path(), "RGBP");
  CameraDevice camera;
  GreyReader reader;
  reader.reserve(kGrey8, 752, 480, false);
  CapturedFrame frame;
  const std::uint64_t before = test::allocationCount();
  const bool no = camera.open(refused).ok();
  const bool yes = camera.open(settings).ok();
  int frames = 0;
  for (int i = 0; i < 20; ++i) {
    stream::wait(camera, frame);
    if (!frame.valid()) continue;
    ++frames;
    CHECK(reader.read(frame.image).size() == 1);
  }
  frame.release();
  const std::uint64_t streaming = test::allocationCount() - before;
  vivid::set(path(), "Disconnect", 1);
  const std::uint64_t again = test::allocationCount();
  for (int i = 0; i < 40 && camera.isOpen(); ++i) stream::wait(camera, frame, 50);
  bool back = false;
  for (int i = 0; i < 40 && !back; ++i) {
    back = camera.open().ok();
    if (!back) ::poll(nullptr, 0, 100);
  }
  const std::uint64_t failing = test::allocationCount() - again;
  CHECK(!no);
  CHECK(yes);
  CHECK(frames >= 18);
  CHECK(back);
  CHECK(streaming == 0);
  CHECK(failing == 0);
}

}  // namespace
}  // namespace swiftlet
