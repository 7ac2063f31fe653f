#pragma once
// Sets any baud rate with the kernel's termios2. A separate source, because its header and <termios.h> define
// the same names differently.

namespace swiftlet {

/// Asks the port for `baud` in both directions; 0 or errno.
int setBaudRate(int descriptor, unsigned baud);
/// What it runs at; 0 or errno.
int readBaudRate(int descriptor, unsigned& baud);

}  // namespace swiftlet
