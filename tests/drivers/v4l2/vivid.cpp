#include "tests/drivers/v4l2/vivid.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>

namespace swiftlet::vivid {

void set(const std::string& path, const std::string& name, int value) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  INFO(path << " " << name);
  REQUIRE(fd >= 0);
  v4l2_queryctrl control = {};
  control.id = V4L2_CTRL_FLAG_NEXT_CTRL;
  bool found = false;
  while (!found && ::ioctl(fd, VIDIOC_QUERYCTRL, &control) == 0) {
    found = name == reinterpret_cast<const char*>(control.name);
    if (!found) control.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
  }
  v4l2_control setting = {control.id, value};
  const bool done = found && ::ioctl(fd, VIDIOC_S_CTRL, &setting) == 0;
  ::close(fd);
  CHECK(found);
  CHECK(done);
}

void write(const std::string& file, const std::string& text) {
  std::ofstream out(file);
  out << text << std::flush;
  INFO(file);
  REQUIRE(out.good());
}

bool limitedRange(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  v4l2_format format = {};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  REQUIRE(::ioctl(fd, VIDIOC_G_FMT, &format) == 0);
  ::close(fd);
  const v4l2_pix_format& pix = format.fmt.pix;
  if (pix.quantization != V4L2_QUANTIZATION_DEFAULT) {
    return pix.quantization == V4L2_QUANTIZATION_LIM_RANGE;
  }
  const bool yuv = pix.pixelformat == V4L2_PIX_FMT_YUYV || pix.pixelformat == V4L2_PIX_FMT_UYVY;
  return yuv;
}

bool waitForNode(const std::string& path, int ms) {
  for (int waited = 0; waited <= ms; waited += 10) {
    if (::access(path.c_str(), F_OK) == 0) return true;
    ::usleep(10'000);
  }
  return false;
}

}  // namespace swiftlet::vivid
