#include "drivers/v4l2/video_node.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace swiftlet {
namespace {

// Signals may interrupt a call; after this many interruptions it fails with EINTR.
constexpr int kMaxInterruptions = 100;

struct Way {
  std::uint32_t capability;
  std::uint32_t type;
};

/// A single-planar interface is preferred if a node has both.
constexpr std::array<Way, 2> kCaptures = {
    {{V4L2_CAP_VIDEO_CAPTURE, V4L2_BUF_TYPE_VIDEO_CAPTURE},
     {V4L2_CAP_VIDEO_CAPTURE_MPLANE, V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE}}};
constexpr std::array<Way, 2> kOutputs = {{{V4L2_CAP_VIDEO_OUTPUT, V4L2_BUF_TYPE_VIDEO_OUTPUT},
                                          {V4L2_CAP_VIDEO_OUTPUT_MPLANE, V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE}}};

/// Arguments of a call: a buffer and the planes that it points to.
struct Request {
  Request(std::uint32_t type, bool several) {
    buffer.type = type;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.field = V4L2_FIELD_NONE;
    if (!several) return;
    buffer.m.planes = planes.data();
    buffer.length = VIDEO_MAX_PLANES;
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;

  v4l2_buffer buffer = {};
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes = {};
};

}  // namespace

DeviceFault VideoNode::open(const char* path, Role role) {
  close();
  struct stat status = {};
  const int fd = ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (fd < 0) return openFault(errno, path);
  fd_ = fd;
  v4l2_capability capability = {};
  errno = 0;
  if (::fstat(fd, &status) != 0 || !S_ISCHR(status.st_mode) || call(VIDIOC_QUERYCAP, &capability) != 0) {
    const bool gone = errno == ENODEV;
    close();
    return gone ? openFault(ENODEV, path)
                : deviceFault(DeviceFaultKind::kWrongDevice, 0, "%s is not a video node", path);
  }
  const std::uint32_t offered = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                    ? capability.device_caps
                                    : capability.capabilities;
  const auto& ways = role == Role::kCapture ? kCaptures : kOutputs;
  const auto* way = std::ranges::find_if(ways, [&](const Way& w) { return (offered & w.capability) != 0; });
  if (way == ways.end()) {
    close();
    return deviceFault(DeviceFaultKind::kWrongDevice, 0, "%.32s: this node does not %s images",
                       reinterpret_cast<const char*>(capability.card),
                       role == Role::kCapture ? "capture" : "take");
  }
  type_ = way->type;
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

int callNode(int fd, unsigned long request, void* argument) {
  for (int i = 0; i < kMaxInterruptions; ++i) {
    const int result = ::ioctl(fd, request, argument);
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

bool VideoNode::severalPlanes() const { return V4L2_TYPE_IS_MULTIPLANAR(type_); }

int VideoNode::readFormat(NodeFormat& format) const {
  v4l2_format f = {};
  f.type = type_;
  if (call(VIDIOC_G_FMT, &f) != 0) return -1;
  const v4l2_pix_format& one = f.fmt.pix;
  const v4l2_pix_format_mplane& several = f.fmt.pix_mp;
  // Both structures have the same members at different offsets.
  const auto read = [&](const auto& pix, std::uint32_t stride) {
    format = {pix.pixelformat, static_cast<int>(pix.width), static_cast<int>(pix.height),
              static_cast<int>(stride), pix.field == V4L2_FIELD_NONE || pix.field == V4L2_FIELD_ANY};
  };
  if (severalPlanes()) {
    read(several, several.plane_fmt[0].bytesperline);
  } else {
    read(one, one.bytesperline);
  }
  return 0;
}

int VideoNode::setFormat(NodeFormat& format) const {
  v4l2_format f = {};
  f.type = type_;
  // Keep all other fields as the driver has set them.
  if (call(VIDIOC_G_FMT, &f) != 0) return -1;
  const auto write = [&](auto& pix) {
    pix.pixelformat = format.fourcc;
    pix.width = static_cast<std::uint32_t>(format.width);
    pix.height = static_cast<std::uint32_t>(format.height);
    pix.field = V4L2_FIELD_NONE;
  };
  if (severalPlanes()) {
    write(f.fmt.pix_mp);
    for (v4l2_plane_pix_format& plane : f.fmt.pix_mp.plane_fmt) plane = {};
  } else {
    write(f.fmt.pix);
    f.fmt.pix.bytesperline = 0;
    f.fmt.pix.sizeimage = 0;
  }
  if (call(VIDIOC_S_FMT, &f) != 0) return -1;
  return readFormat(format);
}

DeviceFault VideoNode::mapBuffers(std::uint32_t count) {
  v4l2_requestbuffers request = {};
  request.count = std::min<std::uint32_t>(count, kMaxBuffers);
  request.type = type_;
  request.memory = V4L2_MEMORY_MMAP;
  if (call(VIDIOC_REQBUFS, &request) != 0) return callFault(errno, "requesting buffers (VIDIOC_REQBUFS)");
  // Some drivers allocate more buffers than requested.
  const std::size_t given = std::min<std::size_t>(request.count, kMaxBuffers);
  for (std::size_t i = 0; i < given; ++i) {
    Request asked(type_, severalPlanes());
    asked.buffer.index = static_cast<std::uint32_t>(i);
    if (call(VIDIOC_QUERYBUF, &asked.buffer) != 0) {
      return callFault(errno, "querying a buffer (VIDIOC_QUERYBUF)");
    }
    const std::size_t length = severalPlanes() ? asked.planes[0].length : asked.buffer.length;
    const std::uint32_t offset = severalPlanes() ? asked.planes[0].m.mem_offset : asked.buffer.m.offset;
    void* bytes = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, offset);
    if (bytes == MAP_FAILED) return callFault(errno, "mapping a buffer (mmap)");
    buffers_[buffer_count_++] = {static_cast<std::uint8_t*>(bytes), length};
    planes_ = severalPlanes() ? asked.buffer.length : 1;
    stamp_flags_ = asked.buffer.flags & (V4L2_BUF_FLAG_TIMESTAMP_MASK | V4L2_BUF_FLAG_TSTAMP_SRC_MASK);
  }
  return {};
}

bool VideoNode::queue(std::uint32_t index, std::size_t used) const {
  Request handed(type_, severalPlanes());
  handed.buffer.index = index;
  if (severalPlanes()) {
    handed.buffer.length = planes_;
    handed.planes[0].bytesused = static_cast<std::uint32_t>(used);
  } else {
    handed.buffer.bytesused = static_cast<std::uint32_t>(used);
  }
  return call(VIDIOC_QBUF, &handed.buffer) == 0;
}

bool VideoNode::dequeue(FilledBuffer& filled) const {
  constexpr std::int64_t kNsPerUs = 1'000;
  constexpr std::int64_t kNsPerS = 1'000'000'000;
  Request taken(type_, severalPlanes());
  if (call(VIDIOC_DQBUF, &taken.buffer) != 0) return false;
  const v4l2_buffer& buffer = taken.buffer;
  std::size_t begin = 0;
  std::size_t end = buffer.bytesused;
  if (severalPlanes()) {
    begin = taken.planes[0].data_offset;
    end = taken.planes[0].bytesused;
  }
  const std::span<const std::uint8_t> all = buffers_[buffer.index];
  end = std::min(end, all.size());
  begin = std::min(begin, end);
  filled = {buffer.index,
            buffer.flags,
            buffer.sequence,
            {buffer.timestamp.tv_sec * kNsPerS + buffer.timestamp.tv_usec * kNsPerUs},
            all.subspan(begin, end - begin)};
  return true;
}

DeviceFault VideoNode::start() {
  if (call(VIDIOC_STREAMON, &type_) != 0) {
    const bool unlinked = errno == ENOLINK || errno == EPIPE;
    return callFault(errno, unlinked ? "starting the stream: this camera's parts are not linked, or differ "
                                       "in format; see `media-ctl -p`"
                                     : "starting the stream (VIDIOC_STREAMON)");
  }
  streaming_ = true;
  return {};
}

bool VideoNode::inError() const {
  pollfd waiting = {fd_, POLLIN | POLLOUT, 0};
  return ::poll(&waiting, 1, 0) > 0 && (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
}

}  // namespace swiftlet
