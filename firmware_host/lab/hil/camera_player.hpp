#pragma once
// Shows a log's images on a camera of the kernel's vivid driver, through its output node, and breaks the
// camera when told to.
//
// The driver takes the next image from its output's queue at each of its instants (whole periods of
// CLOCK_MONOTONIC): an image that waits there is seen exactly once, one that comes late not until the next
// instant, with the one before seen twice. So two images are kept waiting.

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_output.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class CameraPlayer {
 public:
  /// Images that wait to be seen, at the most.
  static constexpr std::size_t kAhead = 2;

  /// `output`: the node to write to; `capture`: the node that shows it, whose driver's switches break it.
  DeviceFault open(const std::string& output, const std::string& capture, int width, int height);

  void close() { output_.close(); }

  /// Whether there is room for an image now.
  [[nodiscard]] bool wantsImage();
  /// Images written and not yet seen.
  [[nodiscard]] std::size_t waiting() const { return output_.queued(); }
  DeviceFault show(const ImageView& image) { return output_.write(image); }
  /// All of it `grey`.
  DeviceFault showDark(int grey);

  /// The driver's "Disconnect": readers get ENODEV, and the node returns when they have closed it.
  DeviceFault unplug();
  /// The driver's "Percentage of Dropped Buffers", all or none. Its output also stops: waiting images are old
  /// when it continues.
  DeviceFault stall(bool on);
  /// The next frame comes as a damaged one. Between an output's instant, half a period after the camera's,
  /// and the camera's next: the driver damages what comes first.
  DeviceFault damage();

 private:
  DeviceFault setControl(const char* name, int value);

  VideoOutput output_;
  std::string capture_;
  std::vector<std::uint8_t> dark_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace swiftlet
