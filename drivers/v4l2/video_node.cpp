#include "drivers/v4l2/video_node.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace swiftlet {
namespace {

// A signal may interrupt a call; without end only if signals come without end.
constexpr int kMaxInterruptions = 100;

DeviceFault roleFault(const v4l2_capability& capability, std::uint32_t offered, std::uint32_t type) {
  const bool capture = type == V4L2_BUF_TYPE_VIDEO_CAPTURE;
  const char* card = reinterpret_cast<const char*>(capability.card);
  if ((offered & (V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_VIDEO_OUTPUT_MPLANE)) != 0) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "%.32s: images in several planes, which is not supported", card);
  }
  return deviceFault(DeviceFaultKind::kWrongDevice, 0, "%.32s: this node does not %s images", card,
                     capture ? "capture" : "take");
}

}  // namespace

DeviceFault VideoNode::open(const char* path, std::uint32_t type) {
  close();
  struct stat status = {};
  const int fd = ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (fd < 0) return openFault(errno, path);
  fd_ = fd;
  type_ = type;
  v4l2_capability capability = {};
  errno = 0;
  if (::fstat(fd, &status) != 0 || !S_ISCHR(status.st_mode) || call(VIDIOC_QUERYCAP, &capability) != 0) {
    const bool gone = errno == ENODEV;
    close();
    return gone ? openFault(ENODEV, path)
                : deviceFault(DeviceFaultKind::kWrongDevice, 0, "%s is no video node", path);
  }
  const std::uint32_t offered = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                    ? capability.device_caps
                                    : capability.capabilities;
  const std::uint32_t needed =
      type == V4L2_BUF_TYPE_VIDEO_CAPTURE ? V4L2_CAP_VIDEO_CAPTURE : V4L2_CAP_VIDEO_OUTPUT;
  if ((offered & needed) == 0) {
    close();
    return roleFault(capability, offered, type);
  }
  if ((offered & V4L2_CAP_STREAMING) == 0) {
    close();
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "%.32s: offers no streaming, only read()",
                       reinterpret_cast<const char*>(capability.card));
  }
  return {};
}

void VideoNode::close() {
  if (fd_ < 0) return;
  if (streaming_) call(VIDIOC_STREAMOFF, &type_);
  for (std::size_t i = 0; i < buffer_count_; ++i) ::munmap(buffers_[i].data(), buffers_[i].size());
  ::close(fd_);
  fd_ = -1;
  streaming_ = false;
  buffer_count_ = 0;
  stamp_flags_ = 0;
  buffers_ = {};
}

int VideoNode::call(unsigned long request, void* argument) const {
  for (int i = 0; i < kMaxInterruptions; ++i) {
    const int result = ::ioctl(fd_, request, argument);
    if (result != -1 || errno != EINTR) return result;
  }
  return -1;
}

DeviceFault VideoNode::callFault(int error, const char* what) {
  DeviceFaultKind kind = DeviceFaultKind::kFailed;
  if (error == ENODEV) kind = DeviceFaultKind::kUnplugged;
  if (error == EBUSY) kind = DeviceFaultKind::kBusy;
  return deviceFault(kind, error, "%s", what);
}

DeviceFault VideoNode::mapBuffers(std::uint32_t count) {
  v4l2_requestbuffers request = {};
  request.count = std::min<std::uint32_t>(count, kMaxBuffers);
  request.type = type_;
  request.memory = V4L2_MEMORY_MMAP;
  if (call(VIDIOC_REQBUFS, &request) != 0) return callFault(errno, "asked for buffers (VIDIOC_REQBUFS)");
  // Some drivers give more than they are asked for.
  const std::size_t given = std::min<std::size_t>(request.count, kMaxBuffers);
  for (std::size_t i = 0; i < given; ++i) {
    v4l2_buffer buffer = {};
    buffer.index = static_cast<std::uint32_t>(i);
    buffer.type = type_;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (call(VIDIOC_QUERYBUF, &buffer) != 0) return callFault(errno, "asked for a buffer (VIDIOC_QUERYBUF)");
    void* bytes = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_,
                         buffer.m.offset);
    if (bytes == MAP_FAILED) return callFault(errno, "mapped a buffer (mmap)");
    buffers_[buffer_count_++] = {static_cast<std::uint8_t*>(bytes), buffer.length};
    stamp_flags_ = buffer.flags & (V4L2_BUF_FLAG_TIMESTAMP_MASK | V4L2_BUF_FLAG_TSTAMP_SRC_MASK);
  }
  return {};
}

DeviceFault VideoNode::start() {
  if (call(VIDIOC_STREAMON, &type_) != 0) return callFault(errno, "started streaming (VIDIOC_STREAMON)");
  streaming_ = true;
  return {};
}

bool VideoNode::inError() const {
  pollfd waiting = {fd_, POLLIN | POLLOUT, 0};
  return ::poll(&waiting, 1, 0) > 0 && (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
}

}  // namespace swiftlet
