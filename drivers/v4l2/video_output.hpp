#pragma once
// Writes 8-bit images to a V4L2 output node, which shows them on a capture node (vivid's loop, v4l2loopback):
// how a recorded flight gets into a camera. Not for flight.
//
// Threads: one. Nothing waits: poll fd() for POLLOUT, or ask canWrite().
// The driver shows an image for as long as no newer one is there, and holds the last ones back: keep two or
// more queued, and write the last image again `kHeldBack` times at the end.

#include <cstdint>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_node.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class VideoOutput {
 public:
  /// Images that may never be shown after the last write.
  static constexpr int kHeldBack = 4;

  /// GREY of this size, no other is accepted.
  DeviceFault open(const char* path, int width, int height);
  void close() { node_.close(); }
  [[nodiscard]] bool isOpen() const { return node_.isOpen(); }
  [[nodiscard]] int fd() const { return node_.fd(); }

  /// Takes back what has been shown. False: all buffers wait to be shown.
  [[nodiscard]] bool canWrite();
  /// Copies the image; the node starts with the second one. kUnsupported: wrong size; kBusy: no buffer is
  /// free.
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
  std::uint32_t free_ = 0;  // a bit for each buffer
};

}  // namespace swiftlet
