#include "drivers/v4l2/camera_controls.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>

namespace swiftlet {
namespace {

// The unit of V4L2_CID_EXPOSURE_ABSOLUTE.
constexpr std::int64_t kExposureUnitNs = 100'000;

bool has(const VideoNode& node, std::uint32_t id) {
  v4l2_queryctrl control = {};
  control.id = id;
  return node.call(VIDIOC_QUERYCTRL, &control) == 0 && (control.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
}

std::optional<std::int32_t> read(const VideoNode& node, std::uint32_t id) {
  v4l2_control control = {id, 0};
  if (!has(node, id) || node.call(VIDIOC_G_CTRL, &control) != 0) return std::nullopt;
  return control.value;
}

/// Clamped to the control's range first: drivers clamp some values and refuse others. 0 or errno.
int write(const VideoNode& node, std::uint32_t id, std::int64_t value) {
  v4l2_queryctrl range = {};
  range.id = id;
  if (node.call(VIDIOC_QUERYCTRL, &range) != 0) return errno;
  v4l2_control control = {id, 0};
  control.value = static_cast<std::int32_t>(std::clamp<std::int64_t>(value, range.minimum, range.maximum));
  return node.call(VIDIOC_S_CTRL, &control) == 0 ? 0 : errno;
}

/// Automatics that stand in the way of a value set by hand; a camera without them needs none.
void writeIfThere(const VideoNode& node, std::uint32_t id, std::int32_t value) {
  if (has(node, id)) write(node, id, value);
}

std::uint32_t gainControl(const VideoNode& node) {
  return has(node, V4L2_CID_GAIN) ? V4L2_CID_GAIN : V4L2_CID_ANALOGUE_GAIN;
}

}  // namespace

DeviceFault setExposure(const VideoNode& node, Duration exposure) {
  if (!has(node, V4L2_CID_EXPOSURE_ABSOLUTE)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "no exposure time to set%s; set it by the camera's own means, and remove it here",
                       has(node, V4L2_CID_EXPOSURE) ? " (only an exposure in the sensor's lines)" : "");
  }
  writeIfThere(node, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
  writeIfThere(node, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);
  const int error = write(node, V4L2_CID_EXPOSURE_ABSOLUTE, exposure.ns / kExposureUnitNs);
  if (error != 0) return VideoNode::callFault(error, "set the exposure time");
  const std::optional<Duration> set = readExposure(node);
  if (!set || std::max(*set - exposure, exposure - *set).ns > kExposureUnitNs) {
    return deviceFault(DeviceFaultKind::kChanged, 0, "exposure: asked %.1f ms, set %.1f ms",
                       exposure.seconds() * 1e3, set.value_or(Duration{}).seconds() * 1e3);
  }
  return {};
}

DeviceFault setGain(const VideoNode& node, std::int32_t gain) {
  const std::uint32_t id = gainControl(node);
  if (!has(node, id)) return deviceFault(DeviceFaultKind::kUnsupported, 0, "no gain to set");
  writeIfThere(node, V4L2_CID_AUTOGAIN, 0);
  const int error = write(node, id, gain);
  if (error != 0) return VideoNode::callFault(error, "set the gain");
  const std::optional<std::int32_t> set = read(node, id);
  if (set != gain) {
    return deviceFault(DeviceFaultKind::kChanged, 0, "gain: asked %d, set %d", gain, set.value_or(0));
  }
  return {};
}

std::optional<Duration> readExposure(const VideoNode& node) {
  const std::optional<std::int32_t> units = read(node, V4L2_CID_EXPOSURE_ABSOLUTE);
  if (!units) return std::nullopt;
  return Duration{*units * kExposureUnitNs};
}

std::optional<std::int32_t> readGain(const VideoNode& node) { return read(node, gainControl(node)); }

}  // namespace swiftlet
