#pragma once
// Sets any baud rate with the kernel's termios2. A separate source, because its header and <termios.h> define
// the same names differently.

namespace swiftlet {

/// Sets `baud` in both directions. Returns 0 or errno.
int setBaudRate(int descriptor, unsigned baud);
/// Reads the actual baud rate. Returns 0 or errno.
int readBaudRate(int descriptor, unsigned& baud);

}  // namespace swiftlet
