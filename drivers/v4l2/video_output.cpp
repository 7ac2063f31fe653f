#include "drivers/v4l2/video_output.hpp"

#include <linux/videodev2.h>

#include <bit>
#include <cerrno>
#include <cstring>

namespace swiftlet {
namespace {

constexpr std::uint32_t kOutput = V4L2_BUF_TYPE_VIDEO_OUTPUT;
constexpr std::uint32_t kBuffers = 4;
constexpr std::size_t kStartWith = 2;  // with one, the driver would show it twice

v4l2_buffer bufferOf(std::uint32_t index) {
  v4l2_buffer buffer = {};
  buffer.index = index;
  buffer.type = kOutput;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.field = V4L2_FIELD_NONE;
  return buffer;
}

}  // namespace

DeviceFault VideoOutput::open(const char* path, int width, int height) {
  started_ = false;
  queued_ = 0;
  free_ = 0;
  DeviceFault fault = node_.open(path, kOutput);
  if (!fault.ok()) return fault;
  v4l2_format format = {};
  format.type = kOutput;
  v4l2_pix_format& pix = format.fmt.pix;
  if (node_.call(VIDIOC_G_FMT, &format) != 0) fault = VideoNode::callFault(errno, "read the format");
  pix.pixelformat = V4L2_PIX_FMT_GREY;
  pix.width = static_cast<std::uint32_t>(width);
  pix.height = static_cast<std::uint32_t>(height);
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = 0;
  pix.sizeimage = 0;
  if (fault.ok() && node_.call(VIDIOC_S_FMT, &format) != 0)
    fault = VideoNode::callFault(errno, "set the format");
  if (fault.ok() && (pix.pixelformat != V4L2_PIX_FMT_GREY || pix.width != static_cast<std::uint32_t>(width) ||
                     pix.height != static_cast<std::uint32_t>(height))) {
    fault = deviceFault(DeviceFaultKind::kChanged, 0, "asked %dx%d GREY, set %ux%u", width, height, pix.width,
                        pix.height);
  }
  width_ = width;
  height_ = height;
  stride_ = static_cast<int>(pix.bytesperline);
  if (fault.ok()) fault = node_.mapBuffers(kBuffers);
  for (std::size_t i = 0; fault.ok() && i < node_.bufferCount(); ++i) {
    free_ |= 1U << i;
    const std::size_t needed = static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height_);
    if (node_.buffer(i).size() < needed) {
      fault = deviceFault(DeviceFaultKind::kUnsupported, 0, "gave buffers smaller than an image");
    }
  }
  if (!fault.ok()) close();
  return fault;
}

void VideoOutput::takeBack() {
  for (std::size_t i = 0; started_ && i < VideoNode::kMaxBuffers; ++i) {
    v4l2_buffer buffer = bufferOf(0);
    if (node_.call(VIDIOC_DQBUF, &buffer) != 0) return;
    free_ |= 1U << buffer.index;
    --queued_;
  }
}

bool VideoOutput::canWrite() {
  if (!isOpen()) return false;
  takeBack();
  return free_ != 0;
}

DeviceFault VideoOutput::write(const ImageView& image) {
  if (!isOpen()) return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed");
  if (image.width != width_ || image.height != height_) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "an image of %dx%d on a node set to %dx%d",
                       image.width, image.height, width_, height_);
  }
  if (!canWrite()) return deviceFault(DeviceFaultKind::kBusy, 0, "all buffers wait to be shown");
  const auto index = static_cast<std::uint32_t>(std::countr_zero(free_));
  std::uint8_t* out = node_.buffer(index).data();
  for (int y = 0; y < height_; ++y, out += stride_) {
    std::memcpy(out, image.row(y), static_cast<std::size_t>(width_));
  }
  v4l2_buffer buffer = bufferOf(index);
  buffer.bytesused = static_cast<std::uint32_t>(stride_) * static_cast<std::uint32_t>(height_);
  if (node_.call(VIDIOC_QBUF, &buffer) != 0) {
    return VideoNode::callFault(errno, "handed an image over (VIDIOC_QBUF)");
  }
  free_ &= ~(1U << index);
  if (++queued_ < kStartWith || started_) return {};
  DeviceFault fault = node_.start();
  started_ = fault.ok();
  return fault;
}

}  // namespace swiftlet
