#pragma once
// Interface for V4L2 control calls: to a video node, a sensor's subdevice or a test double.

namespace swiftlet {

class ControlPort {
 public:
  ControlPort() = default;
  ControlPort(const ControlPort&) = delete;
  ControlPort& operator=(const ControlPort&) = delete;
  virtual ~ControlPort() = default;

  /// ioctl, repeated if a signal interrupts it. Returns -1 and sets errno on failure.
  virtual int call(unsigned long request, void* argument) const = 0;
};

/// ioctl on a descriptor, repeated if a signal interrupts it.
int callNode(int fd, unsigned long request, void* argument);

}  // namespace swiftlet
