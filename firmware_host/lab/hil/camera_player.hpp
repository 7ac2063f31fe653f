#pragma once
// Shows a log's images on a camera of the kernel's vivid driver, through its output node, and simulates
// faults of the camera.
//
// The driver takes the next image from its output's queue at each of its instants (whole periods of
// CLOCK_MONOTONIC). An image that waits at that time is seen exactly once; a late image is not seen until the
// next instant, and the previous one is seen twice. So two images are kept waiting.

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_output.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

class CameraPlayer {
 public:
  /// Most images waiting to be seen.
  static constexpr std::size_t kAhead = 2;

  /// `output`: the node to write to; `capture`: the node that shows it and whose controls simulate faults.
  DeviceFault open(const std::string& output, const std::string& capture, int width, int height);

  void close() { output_.close(); }

  /// Whether there is room for an image now.
  [[nodiscard]] bool wantsImage();
  /// Images written and not yet seen.
  [[nodiscard]] std::size_t waiting() const { return output_.queued(); }
  DeviceFault show(const ImageView& image) { return output_.write(image); }
  /// Shows an image of uniform `grey`.
  DeviceFault showDark(int grey);

  /// The driver's "Disconnect": readers get ENODEV, and the node returns after they have closed it.
  DeviceFault unplug();
  /// The driver's "Percentage of Dropped Buffers", all or none. The output also stops, so waiting images are
  /// outdated when it continues.
  DeviceFault stall(bool on);
  /// Damages the next frame. Call between an output's instant, half a period after the camera's, and the
  /// camera's next one: the driver damages whichever comes first.
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
