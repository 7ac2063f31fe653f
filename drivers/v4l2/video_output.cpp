#include "drivers/v4l2/video_output.hpp"

#include <linux/videodev2.h>

#include <bit>
#include <cerrno>
#include <cstring>

namespace swiftlet {
namespace {

constexpr std::uint32_t kBuffers = 4;
constexpr std::size_t kStartWith = 2;  // with only one the driver would show it twice

}  // namespace

DeviceFault VideoOutput::open(const char* path, int width, int height) {
  started_ = false;
  queued_ = 0;
  free_ = 0;
  DeviceFault fault = node_.open(path, VideoNode::Role::kOutput);
  if (!fault.ok()) return fault;
  NodeFormat format = {V4L2_PIX_FMT_GREY, width, height};
  if (node_.setFormat(format) != 0) fault = VideoNode::callFault(errno, "setting the format");
  if (fault.ok() &&
      (format.fourcc != V4L2_PIX_FMT_GREY || format.width != width || format.height != height)) {
    fault = deviceFault(DeviceFaultKind::kChanged, 0, "requested %dx%d GREY, set %dx%d", width, height,
                        format.width, format.height);
  }
  width_ = width;
  height_ = height;
  stride_ = format.stride;
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
    FilledBuffer shown;
    if (!node_.dequeue(shown)) return;
    free_ |= 1U << shown.index;
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
  if (!canWrite()) return deviceFault(DeviceFaultKind::kBusy, 0, "all buffers are waiting to be shown");
  const auto index = static_cast<std::uint32_t>(std::countr_zero(free_));
  std::uint8_t* out = node_.buffer(index).data();
  for (int y = 0; y < height_; ++y, out += stride_) {
    std::memcpy(out, image.row(y), static_cast<std::size_t>(width_));
  }
  if (!node_.queue(index, static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height_))) {
    return VideoNode::callFault(errno, "queuing an image (VIDIOC_QBUF)");
  }
  free_ &= ~(1U << index);
  if (++queued_ < kStartWith || started_) return {};
  DeviceFault fault = node_.start();
  started_ = fault.ok();
  return fault;
}

}  // namespace swiftlet
