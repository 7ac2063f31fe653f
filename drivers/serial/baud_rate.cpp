#include "drivers/serial/baud_rate.hpp"

#include <asm/ioctls.h>
#include <asm/termbits.h>

#include <cerrno>

// Declared here because <sys/ioctl.h> conflicts with <asm/termbits.h>.
extern "C" int ioctl(int descriptor, unsigned long request, ...) noexcept;

namespace swiftlet {

int setBaudRate(int descriptor, unsigned baud) {
  struct termios2 settings = {};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return errno;
  settings.c_cflag &= ~static_cast<tcflag_t>(CBAUD | (CBAUD << IBSHIFT));
  settings.c_cflag |= static_cast<tcflag_t>(BOTHER | (BOTHER << IBSHIFT));
  settings.c_ispeed = baud;
  settings.c_ospeed = baud;
  return ioctl(descriptor, TCSETS2, &settings) == 0 ? 0 : errno;
}

int readBaudRate(int descriptor, unsigned& baud) {
  struct termios2 settings = {};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return errno;
  baud = settings.c_ospeed;
  return 0;
}

}  // namespace swiftlet
