#include "drivers/serial/pseudo_terminal.hpp"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <utility>

namespace swiftlet {

DeviceFault PseudoTerminal::open() {
  hangUp();
  descriptor_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor_ < 0) return openFault(errno, "posix_openpt");
  std::array<char, 64> name = {};
  if (grantpt(descriptor_) != 0 || unlockpt(descriptor_) != 0 ||
      ptsname_r(descriptor_, name.data(), name.size()) != 0) {
    const int error = errno;
    hangUp();
    return deviceFault(DeviceFaultKind::kFailed, error, "unlockpt");
  }
  path_ = name.data();
  other_end_ = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  termios settings = {};
  // Raw mode from the start: otherwise bytes sent before a program opens the port would be echoed back as its
  // answer.
  if (other_end_ < 0 || tcgetattr(other_end_, &settings) != 0) {
    const int error = errno;
    hangUp();
    return deviceFault(DeviceFaultKind::kFailed, error, "open %s", name.data());
  }
  cfmakeraw(&settings);
  if (tcsetattr(other_end_, TCSANOW, &settings) != 0)
    return deviceFault(DeviceFaultKind::kFailed, errno, "tcsetattr");
  return {};
}

void PseudoTerminal::hangUp() {
  if (other_end_ >= 0) ::close(std::exchange(other_end_, -1));
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

DeviceFault PseudoTerminal::send(std::span<const std::uint8_t> bytes, std::size_t& taken) {
  taken = 0;
  if (descriptor_ < 0) return deviceFault(DeviceFaultKind::kUnplugged, 0, "hung up");
  const ssize_t sent = ::write(descriptor_, bytes.data(), bytes.size());
  if (sent >= 0) {
    taken = static_cast<std::size_t>(sent);
    return {};
  }
  if (errno == EAGAIN || errno == EINTR) return {};
  return deviceFault(DeviceFaultKind::kFailed, errno, "write");
}

DeviceFault PseudoTerminal::receive(std::span<std::uint8_t> into, std::size_t& count) {
  count = 0;
  if (descriptor_ < 0) return deviceFault(DeviceFaultKind::kUnplugged, 0, "hung up");
  const ssize_t got = ::read(descriptor_, into.data(), into.size());
  if (got >= 0) {
    count = static_cast<std::size_t>(got);
    return {};
  }
  if (errno == EAGAIN || errno == EINTR || errno == EIO) return {};
  return deviceFault(DeviceFaultKind::kFailed, errno, "read");
}

std::size_t PseudoTerminal::unread() const {
  int bytes = 0;
  if (other_end_ < 0 || ioctl(other_end_, FIONREAD, &bytes) != 0) return 0;
  return static_cast<std::size_t>(bytes);
}

}  // namespace swiftlet
