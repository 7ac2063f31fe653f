#pragma once
// An open video node and its mapped buffers, for capture and output, single-planar and multi-planar. Of
// several planes only the first, which has the luma, is mapped. The destructor unmaps and closes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/control_port.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Format of a node, as in v4l2_pix_format.
struct NodeFormat {
  std::uint32_t fourcc = 0;
  int width = 0;      ///< pixels
  int height = 0;     ///< pixels
  int stride = 0;     ///< bytes per row, as the driver sets it
  bool whole = true;  ///< false: interlaced
};

/// A buffer that the driver has filled.
struct FilledBuffer {
  std::uint32_t index = 0;
  std::uint32_t flags = 0;
  std::uint32_t sequence = 0;
  Stamp stamp;
  std::span<const std::uint8_t> bytes;
};

class VideoNode : public ControlPort {
 public:
  /// Capacity of this class; drivers give 2 to 32, and more than 8 only add delay.
  static constexpr std::size_t kMaxBuffers = 8;

  VideoNode() = default;
  ~VideoNode() override { close(); }

  enum class Role : std::uint8_t { kCapture, kOutput };

  /// Opens in non-blocking mode. A node that cannot stream in this role is refused; the fault says what it
  /// is.
  DeviceFault open(const char* path, Role role);
  void close();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }
  /// V4L2_BUF_TYPE_..., for other callers.
  [[nodiscard]] std::uint32_t type() const { return type_; }

  int call(unsigned long request, void* argument) const override { return callNode(fd_, request, argument); }
  /// The fault of a failed call: unplugged, busy, or the kernel's error text. `what` names the call.
  [[nodiscard]] static DeviceFault callFault(int error, const char* what);

  /// The node's current format. Returns 0, or -1 and errno.
  int readFormat(NodeFormat& format) const;
  /// Requests complete images without padding; `format` then holds the driver's choice. Returns 0, or -1 and
  /// errno.
  int setFormat(NodeFormat& format) const;

  /// Requests `count` buffers and maps as many as the driver allocates.
  DeviceFault mapBuffers(std::uint32_t count);
  [[nodiscard]] std::size_t bufferCount() const { return buffer_count_; }
  [[nodiscard]] std::span<std::uint8_t> buffer(std::size_t index) const { return buffers_[index]; }
  /// The driver's timestamp flags, known once buffers are mapped.
  [[nodiscard]] std::uint32_t stampFlags() const { return stamp_flags_; }

  DeviceFault start();
  /// Passes a buffer to the driver. `used`: image bytes of an output buffer. On failure false and errno.
  [[nodiscard]] bool queue(std::uint32_t index, std::size_t used = 0) const;
  /// Takes the next finished buffer from the driver. On failure false and errno: EAGAIN if there is none.
  [[nodiscard]] bool dequeue(FilledBuffer& filled) const;
  /// Whether poll() reports an error or a hang-up: no more images will arrive.
  [[nodiscard]] bool inError() const;

 private:
  [[nodiscard]] bool severalPlanes() const;

  int fd_ = -1;
  std::uint32_t type_ = 0;
  bool streaming_ = false;
  std::uint32_t stamp_flags_ = 0;
  std::uint32_t planes_ = 1;
  std::size_t buffer_count_ = 0;
  std::array<std::span<std::uint8_t>, kMaxBuffers> buffers_{};
};

}  // namespace swiftlet
