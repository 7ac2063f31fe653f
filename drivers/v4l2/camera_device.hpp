#pragma once
// One camera behind a V4L2 capture node: negotiated, streaming into the kernel's buffers, which are lent out
// one by one and go back when they are let go. No copy here: toGrey() makes the only one, into its last
// place.
//
// Threads: one. Nothing waits: poll fd() for POLLIN, then call next() until it gives no frame.
// Errors: values. After a fault of next() the camera is closed; reopen() takes it up when it is there again,
//   with everything negotiated anew. A format that is not taken (MJPG, ...) is refused with what there is.
// Memory: the kernel's buffers (`buffers` images), mapped at open; no allocation. Cost of a frame: two calls.
// Source: linux/videodev2.h; the kernel's Documentation/userspace-api/media/v4l.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/camera_settings.hpp"
#include "drivers/v4l2/raw_image.hpp"
#include "drivers/v4l2/video_node.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class CameraDevice;

/// A frame in the kernel's memory. The device gets it back when this goes out of scope; it must not outlive
/// the CameraDevice, and after close() or reopen() `image` points to nothing.
class CapturedFrame {
 public:
  CapturedFrame() = default;
  CapturedFrame(CapturedFrame&& other) noexcept { *this = std::move(other); }
  CapturedFrame& operator=(CapturedFrame&& other) noexcept;
  ~CapturedFrame() { release(); }

  [[nodiscard]] bool valid() const { return device_ != nullptr; }
  void release();

  RawImage image;
  Stamp stamp;                                 ///< the driver's, CLOCK_MONOTONIC
  StampEvent event = StampEvent::kEndOfFrame;  ///< what it marks
  Stamp arrival;                               ///< CLOCK_MONOTONIC, when it was taken from the queue
  std::uint64_t sequence = 0;                  ///< the driver's count, unwrapped; goes on after a reopen

 private:
  friend class CameraDevice;
  CameraDevice* device_ = nullptr;
  std::uint32_t buffer_ = 0;
  std::uint32_t generation_ = 0;
};

class CameraDevice {
 public:
  CameraDevice() = default;
  CameraDevice(const CameraDevice&) = delete;
  CameraDevice& operator=(const CameraDevice&) = delete;
  ~CameraDevice() { close(); }

  /// Negotiates and starts. Ok: streaming; what the camera lacks or did otherwise but can be flown with (an
  /// exposure clamped) stands in warnings().
  DeviceFault open(const CameraDeviceSettings& settings);
  /// After a fault: the same again. kMissing as long as the node is not there; ask again a few times a
  /// second.
  DeviceFault reopen();
  void close();

  [[nodiscard]] bool isOpen() const { return node_.isOpen(); }
  [[nodiscard]] int fd() const { return node_.fd(); }

  /// The oldest frame that waits. Ok with `frame.valid()` false: none. A fault closes the camera.
  DeviceFault next(CapturedFrame& frame);

  [[nodiscard]] const CameraFacts& facts() const { return facts_; }
  [[nodiscard]] const CameraCounters& counters() const { return counters_; }
  [[nodiscard]] std::span<const DeviceFault> warnings() const { return {warnings_.data(), warning_count_}; }
  /// Asked anew, for automatic exposure; empty where the camera does not say.
  [[nodiscard]] std::optional<Duration> exposure() const;

 private:
  friend class CapturedFrame;

  DeviceFault negotiate();
  DeviceFault chooseFormat();
  DeviceFault setFormat();
  DeviceFault setRate();
  DeviceFault setBuffers();
  void describeDevice();
  void warn(const DeviceFault& fault);
  bool queue(std::uint32_t buffer);
  void giveBack(const CapturedFrame& frame);
  void countSequence(std::uint32_t sequence);
  DeviceFault closedBy(const DeviceFault& fault);

  VideoNode node_;
  CameraDeviceSettings settings_;
  CameraFacts facts_;
  CameraCounters counters_;
  std::array<DeviceFault, 4> warnings_;  // exposure, gain, buffers, stamps
  std::size_t warning_count_ = 0;
  std::uint32_t generation_ = 0;  // raised by every close: frames lent before are not put back
  bool sequence_known_ = false;   // of this stream
  std::uint32_t raw_sequence_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace swiftlet
