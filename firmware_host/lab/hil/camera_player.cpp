#include "firmware_host/lab/hil/camera_player.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace swiftlet {

DeviceFault CameraPlayer::open(const std::string& output, const std::string& capture, int width, int height) {
  capture_ = capture;
  width_ = width;
  height_ = height;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  dark_.assign(pixels, 0);
  return output_.open(output.c_str(), width, height);
}

bool CameraPlayer::wantsImage() { return output_.canWrite() && output_.queued() < kAhead; }

DeviceFault CameraPlayer::showDark(int grey) {
  std::ranges::fill(dark_, static_cast<std::uint8_t>(grey));
  return show({dark_.data(), width_, height_, width_});
}

DeviceFault CameraPlayer::unplug() { return setControl("Disconnect", 0); }
DeviceFault CameraPlayer::stall(bool on) {
  constexpr int kAll = 100;  // percent
  return setControl("Percentage of Dropped Buffers", on ? kAll : 0);
}
DeviceFault CameraPlayer::damage() { return setControl("Inject V4L2_BUF_FLAG_ERROR", 1); }

DeviceFault CameraPlayer::setControl(const char* name, int value) {
  const int fd = ::open(capture_.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return openFault(errno, "injecting a fault");
  v4l2_queryctrl query{};
  query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
  DeviceFault fault = deviceFault(DeviceFaultKind::kUnsupported, 0,
                                  "no control called \"%s\": only vivid's cameras support this fault", name);
  while (ioctl(fd, VIDIOC_QUERYCTRL, &query) == 0) {
    if (std::strcmp(reinterpret_cast<const char*>(query.name), name) == 0) {
      v4l2_control control{query.id, value};
      fault = ioctl(fd, VIDIOC_S_CTRL, &control) == 0
                  ? DeviceFault{}
                  : deviceFault(DeviceFaultKind::kFailed, errno, "%s", name);
      break;
    }
    query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
  }
  ::close(fd);
  return fault;
}

}  // namespace swiftlet
