#pragma once
// Writes 8-bit images to a V4L2 output node that feeds a capture node (vivid's loop, v4l2loopback), to replay
// a recorded flight through a camera device. Not for flight.
//
// Threads: one. Nothing blocks: poll fd() for POLLOUT, or check canWrite(). The driver repeats an image until
// a newer one is queued and holds the last ones back: keep two or more queued, and write the last image
// `kHeldBack` more times at the end.

#include <cstdint>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_node.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class VideoOutput {
 public:
  /// Images that may never be shown after the last write.
  static constexpr int kHeldBack = 4;

  /// Requires GREY of exactly this size.
  DeviceFault open(const char* path, int width, int height);
  void close() { node_.close(); }
  [[nodiscard]] bool isOpen() const { return node_.isOpen(); }
  [[nodiscard]] int fd() const { return node_.fd(); }

  /// Reclaims buffers that have been shown. False: all buffers are still waiting to be shown.
  [[nodiscard]] bool canWrite();
  /// Copies and queues the image; the node starts with the second one. kUnsupported: wrong size; kBusy: no
  /// free buffer.
  DeviceFault write(const ImageView& image);
  /// Images written and not yet shown.
  [[nodiscard]] std::size_t queued() const { return queued_; }

 private:
  void takeBack();

  VideoNode node_;
  int width_ = 0;
  int height_ = 0;
  int stride_ = 0;
  bool started_ = false;
  std::size_t queued_ = 0;
  std::uint32_t free_ = 0;  // one bit per buffer
};

}  // namespace swiftlet
