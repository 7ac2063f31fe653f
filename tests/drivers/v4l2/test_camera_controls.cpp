// Exposure and gain on cameras made of tables: the conversions against figures worked by hand, and the order
// of calls. And sensors found in media graphs.

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdio>
#include <map>
#include <string_view>
#include <vector>

#include "drivers/v4l2/camera_controls.hpp"
#include "drivers/v4l2/sensor_node.hpp"

namespace swiftlet {
namespace {

struct Control {
  std::int64_t least = 0;
  std::int64_t most = 0;
  std::int64_t value = 0;
};

/// Answers as the kernel's control framework does: values out of range are refused.
class TableCamera : public ControlPort {
 public:
  mutable std::map<std::uint32_t, Control> controls;
  mutable std::vector<std::uint32_t> written;
  int height = 0;  ///< of a sensor whose exposure ends 4 lines before its frame; 0: another kind

  int call(unsigned long request, void* argument) const override {
    if (request == VIDIOC_QUERYCTRL) {
      auto* query = static_cast<v4l2_queryctrl*>(argument);
      const auto found = controls.find(query->id);
      if (found == controls.end()) return refuse(EINVAL);
      query->minimum = static_cast<std::int32_t>(found->second.least);
      query->maximum = static_cast<std::int32_t>(found->second.most);
      return 0;
    }
    if (request == VIDIOC_G_CTRL) {
      auto* control = static_cast<v4l2_control*>(argument);
      if (control->id == V4L2_CID_PIXEL_RATE) return refuse(EINVAL);  // 64 bits
      control->value = static_cast<std::int32_t>(controls.at(control->id).value);
      return 0;
    }
    if (request == VIDIOC_S_CTRL) {
      const auto* control = static_cast<v4l2_control*>(argument);
      return write(control->id, control->value);
    }
    auto* list = static_cast<v4l2_ext_controls*>(argument);
    for (std::uint32_t i = 0; i < list->count; ++i) {
      v4l2_ext_control& control = list->controls[i];
      const auto found = controls.find(control.id);
      if (found == controls.end()) return refuse(EINVAL);
      if (request == VIDIOC_G_EXT_CTRLS) {
        control.value64 = found->second.value;
      } else if (write(control.id, control.value) != 0) {
        return -1;
      }
    }
    return 0;
  }

 private:
  static int refuse(int error) {
    errno = error;
    return -1;
  }
  int write(std::uint32_t id, std::int64_t value) const {
    const auto found = controls.find(id);
    if (found == controls.end()) return refuse(EINVAL);
    if (value < found->second.least || value > found->second.most) return refuse(ERANGE);
    found->second.value = value;
    written.push_back(id);
    if (id == V4L2_CID_VBLANK) controls[V4L2_CID_EXPOSURE].most = height + value - 4;
    return 0;
  }
};

/// IMX219 at 1640 x 1232: 3448 pixels a line at 182.4 MHz are 18.9035 us; 1763 lines are 33.327 ms.
void makeImx219(TableCamera& camera) {
  camera.height = 1232;
  camera.controls = {{V4L2_CID_EXPOSURE, {4, 1759, 1000}},
                     {V4L2_CID_HBLANK, {1808, 1808, 1808}},
                     {V4L2_CID_VBLANK, {4, 64303, 531}},
                     {V4L2_CID_ANALOGUE_GAIN, {0, 232, 0}},
                     {V4L2_CID_PIXEL_RATE, {0, 0, 182'400'000}}};
}

void makeWebcam(TableCamera& camera) {
  camera.controls = {{V4L2_CID_EXPOSURE_AUTO, {0, 3, 3}},
                     {V4L2_CID_EXPOSURE_AUTO_PRIORITY, {0, 1, 1}},
                     {V4L2_CID_EXPOSURE_ABSOLUTE, {1, 5000, 157}},
                     {V4L2_CID_GAIN, {0, 100, 30}}};
}

double milliseconds(Duration duration) { return duration.seconds() * 1e3; }

}  // namespace

TEST_CASE("an exposure in lines is converted by the length of a line") {
  TableCamera camera;
  makeImx219(camera);
  CameraControls controls(camera, 1640, "imx219 10-0010");
  REQUIRE(controls.exposes());
  CHECK(milliseconds(*controls.exposure()) == Approx(18.9035).epsilon(1e-5));
  CHECK(controls.setExposure(Duration::fromMilliseconds(5)).ok());
  CHECK(camera.controls[V4L2_CID_EXPOSURE].value == 264);  // 264.50
  CHECK(milliseconds(*controls.exposure()) == Approx(4.99053).epsilon(1e-5));
  // Set again to what was read it stays.
  CHECK(controls.setExposure(*controls.exposure()).ok());
  CHECK(camera.controls[V4L2_CID_EXPOSURE].value == 264);
  CHECK(std::ranges::find(camera.written, V4L2_CID_VBLANK) == camera.written.end());
}

TEST_CASE("the frame is made longer before an exposure that does not fit into it") {
  TableCamera camera;
  makeImx219(camera);
  CameraControls controls(camera, 1640, "imx219 10-0010");
  CHECK(controls.setExposure(Duration::fromMilliseconds(50)).ok());
  CHECK(camera.written == std::vector<std::uint32_t>{V4L2_CID_VBLANK, V4L2_CID_EXPOSURE});
  CHECK(camera.controls[V4L2_CID_EXPOSURE].value == 2645);  // 2645.01
  CHECK(camera.controls[V4L2_CID_VBLANK].value == 2645 + 4 - 1232);
  // In flight never: the rate stays.
  camera.written.clear();
  CHECK(controls.set({Duration::fromMilliseconds(200), 1}).ok());
  CHECK(camera.written == std::vector<std::uint32_t>{V4L2_CID_EXPOSURE, V4L2_CID_ANALOGUE_GAIN});
  CHECK(camera.controls[V4L2_CID_EXPOSURE].value == 2645);
}

TEST_CASE("gains of known sensors are in times of their least") {
  TableCamera camera;
  makeImx219(camera);
  {
    CameraControls controls(camera, 1640, "imx219 10-0010");  // 256 / (256 - code)
    const std::optional<ExposureAbility> ability = controls.ability();
    REQUIRE(ability);
    CHECK(ability->range.most_gain == Approx(256.0 / 24));
    CHECK(milliseconds(ability->range.longest) == Approx(1759 * 0.0189035).epsilon(1e-5));
    CHECK(ability->range.step == Approx(18.9035e-6).epsilon(1e-5));
    CHECK(ability->now.gain == 1);
    for (const auto& [times, code] :
         std::map<double, int>{{0.5, 0}, {2, 128}, {3, 170}, {4, 192}, {99, 232}}) {
      CHECK(controls.set({Duration::fromMilliseconds(5), times}).ok());
      CHECK(camera.controls[V4L2_CID_ANALOGUE_GAIN].value == code);
    }
  }
  camera.controls[V4L2_CID_ANALOGUE_GAIN] = {0, 240, 0};
  CameraControls decibels(camera, 1640, "imx290 4-001a");  // 0.3 dB each: 20 of them are 6 dB
  CHECK(decibels.set({Duration::fromMilliseconds(5), 1.9953}).ok());
  CHECK(camera.controls[V4L2_CID_ANALOGUE_GAIN].value == 20);
  camera.controls[V4L2_CID_ANALOGUE_GAIN] = {16, 255, 16};
  CameraControls sixteenths(camera, 1640, "ov9281 10-0060");
  CHECK(sixteenths.ability()->range.most_gain == Approx(255.0 / 16));
  CHECK(sixteenths.set({Duration::fromMilliseconds(5), 2.5}).ok());
  CHECK(camera.controls[V4L2_CID_ANALOGUE_GAIN].value == 40);
}

TEST_CASE("a webcam's automatics end, and a gain of unknown law stays") {
  TableCamera camera;
  makeWebcam(camera);
  CameraControls controls(camera, 640, "UVC Camera");
  CHECK(milliseconds(*controls.exposure()) == Approx(15.7));
  CHECK(controls.ability()->range.most_gain == 1);
  CHECK(controls.set({Duration::fromMilliseconds(4), 3}).ok());
  CHECK(camera.controls[V4L2_CID_EXPOSURE_AUTO].value == 1);
  CHECK(camera.controls[V4L2_CID_EXPOSURE_AUTO_PRIORITY].value == 0);
  CHECK(camera.controls[V4L2_CID_EXPOSURE_ABSOLUTE].value == 40);
  CHECK(camera.controls[V4L2_CID_GAIN].value == 30);
  // Only once: in flight a request is one call.
  camera.written.clear();
  CHECK(controls.set({Duration::fromMilliseconds(3), 1}).ok());
  CHECK(camera.written.size() == 1);
}

TEST_CASE("a camera that counts lines of unknown length is refused in words") {
  TableCamera camera;
  makeImx219(camera);
  camera.controls.erase(V4L2_CID_PIXEL_RATE);
  CameraControls controls(camera, 1640, "sensor");
  CHECK(!controls.exposes());
  CHECK(!controls.ability());
  const DeviceFault fault = controls.setExposure(Duration::fromMilliseconds(5));
  CHECK(fault.kind == DeviceFaultKind::kUnsupported);
  CHECK(fault.text().find("lines") != std::string_view::npos);
  CHECK(controls.set({Duration::fromMilliseconds(5), 1}).kind == DeviceFaultKind::kUnsupported);
}

TEST_CASE("the sensor before a video node is found by enabled links") {
  // Two sensors before a multiplexer, as on a CSI adapter; receiver; video node 81:0.
  constexpr std::uint32_t kEnabled = MEDIA_LNK_FL_ENABLED;
  const auto entity = [](std::uint32_t id, const char* name, std::uint32_t function) {
    media_v2_entity result = {};
    result.id = id;
    std::snprintf(static_cast<char*>(result.name), sizeof result.name, "%s", name);
    result.function = function;
    return result;
  };
  const auto pad = [](std::uint32_t id, std::uint32_t of) {
    media_v2_pad result = {};
    result.id = id;
    result.entity_id = of;
    return result;
  };
  const auto link = [](std::uint32_t id, std::uint32_t source, std::uint32_t sink, std::uint32_t flags) {
    media_v2_link result = {};
    result.id = id;
    result.source_id = source;
    result.sink_id = sink;
    result.flags = flags;
    return result;
  };
  const std::vector<media_v2_entity> entities = {
      entity(1, "imx219 10-0010", MEDIA_ENT_F_CAM_SENSOR),
      entity(2, "imx219 11-0010", MEDIA_ENT_F_CAM_SENSOR), entity(3, "mux", MEDIA_ENT_F_VID_MUX),
      entity(4, "receiver", MEDIA_ENT_F_VID_IF_BRIDGE), entity(5, "image", MEDIA_ENT_F_IO_V4L)};
  std::vector<media_v2_interface> interfaces(4);
  constexpr std::array<std::uint32_t, 4> kMinors = {5, 6, 7, 0};
  constexpr std::array<std::uint32_t, 4> kIds = {101, 102, 103, 105};
  for (std::size_t i = 0; i < interfaces.size(); ++i) {
    interfaces[i].id = kIds[i];
    interfaces[i].intf_type = i < 3 ? MEDIA_INTF_T_V4L_SUBDEV : MEDIA_INTF_T_V4L_VIDEO;
    interfaces[i].devnode.major = 81;
    interfaces[i].devnode.minor = kMinors[i];
  }
  const std::vector<media_v2_pad> pads = {pad(11, 1), pad(12, 2), pad(13, 3), pad(14, 3),
                                          pad(15, 3), pad(16, 4), pad(17, 4), pad(18, 5)};
  std::vector<media_v2_link> links = {link(21, 11, 13, 0), link(22, 12, 14, kEnabled),
                                      link(23, 15, 16, kEnabled), link(24, 17, 18, kEnabled)};
  for (const std::uint32_t interface : kIds) {
    links.push_back(
        link(interface + 100, interface, interface - 100, kEnabled | MEDIA_LNK_FL_INTERFACE_LINK));
  }
  const MediaGraph graph{entities, interfaces, pads, links};
  std::optional<FoundSensor> sensor = sensorBefore(graph, {81, 0});
  REQUIRE(sensor);
  CHECK(std::string_view(sensor->name.data()) == "imx219 11-0010");
  CHECK(sensor->node == NodeNumber{81, 6});
  // The multiplexer's other way.
  links[0].flags = kEnabled;
  links[1].flags = 0;
  sensor = sensorBefore(graph, {81, 0});
  REQUIRE(sensor);
  CHECK(sensor->node == NodeNumber{81, 5});
  // Nobody enabled, another video node, a circle.
  links[0].flags = 0;
  CHECK(!sensorBefore(graph, {81, 0}));
  CHECK(!sensorBefore(graph, {81, 9}));
  links.push_back(link(40, 17, 13, kEnabled));
  CHECK(!sensorBefore({entities, interfaces, pads, links}, {81, 0}));
}

}  // namespace swiftlet
