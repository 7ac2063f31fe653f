#pragma once
// An open video node and its mapped buffers: what capture and output have in common, and nodes whose images
// are of one plane of memory or of several. Of several the first, which has the luma, is mapped. Closes and
// unmaps itself.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/control_port.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// What a node gives or takes, as in v4l2_pix_format.
struct NodeFormat {
  std::uint32_t fourcc = 0;
  int width = 0;      ///< pixels
  int height = 0;     ///< pixels
  int stride = 0;     ///< bytes from row to row, as the driver has it
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
  /// What the room holds; drivers give 2 to 32, more than 8 only delays.
  static constexpr std::size_t kMaxBuffers = 8;

  VideoNode() = default;
  ~VideoNode() override { close(); }

  enum class Role : std::uint8_t { kCapture, kOutput };

  /// Non-blocking. A node that cannot stream in this role is rejected, and the fault says what it is.
  DeviceFault open(const char* path, Role role);
  void close();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }
  /// V4L2_BUF_TYPE_..., for calls made elsewhere.
  [[nodiscard]] std::uint32_t type() const { return type_; }

  int call(unsigned long request, void* argument) const override { return callNode(fd_, request, argument); }
  /// The fault of the call that just failed: gone, busy, or the kernel's words. `what` names the call.
  [[nodiscard]] static DeviceFault callFault(int error, const char* what);

  /// As the node has it. 0; -1 and errno.
  int readFormat(NodeFormat& format) const;
  /// Requests complete images without padding; afterwards the driver's choice. Returns 0, or -1 and errno.
  int setFormat(NodeFormat& format) const;

  /// Asks for and maps `count` buffers; as many as the driver gave afterwards.
  DeviceFault mapBuffers(std::uint32_t count);
  [[nodiscard]] std::size_t bufferCount() const { return buffer_count_; }
  [[nodiscard]] std::span<std::uint8_t> buffer(std::size_t index) const { return buffers_[index]; }
  /// The flags that the driver gives with its stamps, known once buffers are mapped.
  [[nodiscard]] std::uint32_t stampFlags() const { return stamp_flags_; }

  DeviceFault start();
  /// Hands a buffer to the driver. `used`: bytes of an output's image. False, and errno.
  [[nodiscard]] bool queue(std::uint32_t index, std::size_t used = 0) const;
  /// The next buffer that the driver has finished. False, and errno: EAGAIN if there is none.
  [[nodiscard]] bool dequeue(FilledBuffer& filled) const;
  /// True: poll() reports an error or a hang-up; no more images will arrive.
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
