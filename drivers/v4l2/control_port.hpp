#pragma once
// Something whose V4L2 controls are called: a video node, a sensor's own node, a test's.

namespace swiftlet {

class ControlPort {
 public:
  ControlPort() = default;
  ControlPort(const ControlPort&) = delete;
  ControlPort& operator=(const ControlPort&) = delete;
  virtual ~ControlPort() = default;

  /// ioctl, again when a signal came in between; -1 and errno else.
  virtual int call(unsigned long request, void* argument) const = 0;
};

/// ioctl on a descriptor, repeated if a signal interrupts it.
int callNode(int fd, unsigned long request, void* argument);

}  // namespace swiftlet
