#pragma once
// An open video node and its mapped buffers: what capture and output have in common. Closes and unmaps
// itself.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/device_fault.hpp"

namespace swiftlet {

class VideoNode {
 public:
  /// What the room holds; drivers give 2 to 32, more than 8 only delays.
  static constexpr std::size_t kMaxBuffers = 8;

  VideoNode() = default;
  VideoNode(const VideoNode&) = delete;
  VideoNode& operator=(const VideoNode&) = delete;
  ~VideoNode() { close(); }

  /// Non-blocking. A node that cannot stream `type` (V4L2_BUF_TYPE_...) is refused with what it is.
  DeviceFault open(const char* path, std::uint32_t type);
  void close();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }

  /// ioctl, again when a signal came in between; -1 and errno else.
  int call(unsigned long request, void* argument) const;
  /// The fault of the call that just failed: gone, busy, or the kernel's words. `what` names the call.
  [[nodiscard]] static DeviceFault callFault(int error, const char* what);

  /// Asks for and maps `count` buffers; as many as the driver gave afterwards.
  DeviceFault mapBuffers(std::uint32_t count);
  [[nodiscard]] std::size_t bufferCount() const { return buffer_count_; }
  [[nodiscard]] std::span<std::uint8_t> buffer(std::size_t index) const { return buffers_[index]; }
  /// The flags that the driver gives with its stamps, known once buffers are mapped.
  [[nodiscard]] std::uint32_t stampFlags() const { return stamp_flags_; }

  DeviceFault start();
  /// True: poll() reports an error or a hang-up, so that nothing more will come.
  [[nodiscard]] bool inError() const;

 private:
  int fd_ = -1;
  std::uint32_t type_ = 0;
  bool streaming_ = false;
  std::uint32_t stamp_flags_ = 0;
  std::size_t buffer_count_ = 0;
  std::array<std::span<std::uint8_t>, kMaxBuffers> buffers_{};
};

}  // namespace swiftlet
