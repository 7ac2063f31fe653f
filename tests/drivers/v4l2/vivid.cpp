#include "tests/drivers/v4l2/vivid.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
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

namespace {

/// Whose luma has the limited range where the driver does not say.
bool withChroma(std::uint32_t code) {
  for (const char* letters :
       {"YUYV", "YVYU", "UYVY", "VYUY", "NV12", "NM12", "NV21", "NV16", "YU12", "YM12", "YV12", "422P"}) {
    if (std::memcmp(letters, &code, sizeof(code)) == 0) return true;
  }
  return false;
}

}  // namespace

bool limitedRange(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  v4l2_format format = {};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  const bool one = ::ioctl(fd, VIDIOC_G_FMT, &format) == 0;
  format.type = one ? V4L2_BUF_TYPE_VIDEO_CAPTURE : V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  REQUIRE(::ioctl(fd, VIDIOC_G_FMT, &format) == 0);
  ::close(fd);
  const std::uint32_t range = one ? format.fmt.pix.quantization : format.fmt.pix_mp.quantization;
  if (range != V4L2_QUANTIZATION_DEFAULT) return range == V4L2_QUANTIZATION_LIM_RANGE;
  const std::uint32_t code = one ? format.fmt.pix.pixelformat : format.fmt.pix_mp.pixelformat;
  return withChroma(code);
}

bool waitForNode(const std::string& path, int ms) {
  for (int waited = 0; waited <= ms; waited += 10) {
    if (::access(path.c_str(), F_OK) == 0) return true;
    ::usleep(10'000);
  }
  return false;
}

}  // namespace swiftlet::vivid
