#include "drivers/serial/serial_port.hpp"

#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/serial/baud_rate.hpp"

namespace swiftlet {
namespace {

/// Rounded up, so that a wait below a millisecond is not zero.
int pollMilliseconds(Duration duration) {
  constexpr std::int64_t kNsPerMs = 1'000'000;
  constexpr std::int64_t kLongest = 60'000;
  return static_cast<int>(std::clamp((duration.ns + kNsPerMs - 1) / kNsPerMs, std::int64_t{0}, kLongest));
}

/// Whether the baud rate is real: not for USB CDC and pseudo-terminals.
bool baudMeansSomething(const char* path) {
  std::array<char, PATH_MAX> real = {};
  const std::string_view node = realpath(path, real.data()) != nullptr ? real.data() : path;
  return !node.starts_with("/dev/ttyACM") && !node.starts_with("/dev/pts/");
}

}  // namespace

DeviceFault SerialPort::open() {
  close();
  if (settings_.baud == 0 || settings_.baud > kHighestBaud) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "%u baud requested, 1 to %u possible",
                       settings_.baud, kHighestBaud);
  }
  descriptor_ = ::open(settings_.path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor_ < 0) return openFault(errno, "open");
  const DeviceFault fault = configure();
  if (!fault.ok()) close();
  return fault;
}

DeviceFault SerialPort::configure() {
  termios settings = {};
  if (tcgetattr(descriptor_, &settings) != 0) {
    if (errno == ENOTTY) return deviceFault(DeviceFaultKind::kWrongDevice, 0, "not a serial port");
    return deviceFault(DeviceFaultKind::kFailed, errno, "tcgetattr");
  }
  if (ioctl(descriptor_, TIOCEXCL) != 0) return deviceFault(DeviceFaultKind::kFailed, errno, "TIOCEXCL");
  cfmakeraw(&settings);
  settings.c_cflag |= static_cast<tcflag_t>(CLOCAL | CREAD);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  if (tcsetattr(descriptor_, TCSANOW, &settings) != 0)
    return deviceFault(DeviceFaultKind::kFailed, errno, "tcsetattr");
  if (const int error = setBaudRate(descriptor_, settings_.baud); error != 0)
    return deviceFault(DeviceFaultKind::kUnsupported, error, "%u baud", settings_.baud);
  if (const int error = readBaudRate(descriptor_, baud_); error != 0)
    return deviceFault(DeviceFaultKind::kFailed, error, "TCGETS2");
  // A sampling error of a quarter bit at the stop bit is 2.5 %, shared by both ends.
  constexpr unsigned kAllowedPercent = 2;
  const unsigned off = baud_ > settings_.baud ? baud_ - settings_.baud : settings_.baud - baud_;
  if (off > settings_.baud / 100 * kAllowedPercent + settings_.baud % 100 * kAllowedPercent / 100)
    return deviceFault(DeviceFaultKind::kChanged, 0, "%u baud requested, %u set", settings_.baud, baud_);

  askLowLatency();
  constexpr std::int64_t kBitsPerByte = 10;
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  byte_time_ = {};
  if (baudMeansSomething(settings_.path.c_str())) byte_time_ = Duration{kBitsPerByte * kNsPerSecond / baud_};
  tcflush(descriptor_, TCIFLUSH);
  return {};
}

/// Optional: not all drivers support it.
void SerialPort::askLowLatency() const {
  serial_struct serial = {};
  if (ioctl(descriptor_, TIOCGSERIAL, &serial) != 0) return;
  serial.flags |= static_cast<int>(ASYNC_LOW_LATENCY);
  (void)ioctl(descriptor_, TIOCSSERIAL, &serial);
}

void SerialPort::close() {
  if (descriptor_ < 0) return;
  // Where another descriptor stays open, as at the other end of a pseudo-terminal, the lock would outlive
  // this one.
  (void)ioctl(descriptor_, TIOCNXCL);
  ::close(std::exchange(descriptor_, -1));
}

DeviceFault SerialPort::unplugged(int error) {
  close();
  return deviceFault(DeviceFaultKind::kUnplugged, error, "%s", settings_.path.c_str());
}

DeviceFault SerialPort::read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at) {
  count = 0;
  if (descriptor_ < 0) return unplugged(0);
  const ssize_t got = ::read(descriptor_, into.data(), into.size());
  const int error = errno;
  read_at = monotonicNow();
  if (got > 0) {
    count = static_cast<std::size_t>(got);
    return {};
  }
  if (got < 0 && error == EINTR) return {};
  if (got < 0 && error != EAGAIN) {
    if (error == EIO || error == ENXIO || error == ENODEV) return unplugged(error);
    return deviceFault(DeviceFaultKind::kFailed, error, "read");
  }
  // With VMIN and VTIME 0 both "no data" and, on some drivers, a hang-up give 0 or EAGAIN: poll tells them
  // apart.
  pollfd asked = {descriptor_, POLLIN, 0};
  if (::poll(&asked, 1, 0) > 0 && (asked.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) return unplugged(0);
  return {};
}

DeviceFault SerialPort::wait(Duration most) {
  if (descriptor_ < 0) return unplugged(0);
  pollfd asked = {descriptor_, POLLIN, 0};
  const int ready = ::poll(&asked, 1, pollMilliseconds(most));
  if (ready < 0 && errno != EINTR) return deviceFault(DeviceFaultKind::kFailed, errno, "poll");
  return {};
}

DeviceFault SerialPort::writeSome(std::span<const std::uint8_t> bytes, std::size_t& taken) {
  taken = 0;
  if (descriptor_ < 0) return unplugged(0);
  const ssize_t sent = ::write(descriptor_, bytes.data(), bytes.size());
  if (sent >= 0) {
    taken = static_cast<std::size_t>(sent);
    return {};
  }
  if (errno == EAGAIN || errno == EINTR) return {};
  if (errno == EIO || errno == ENXIO || errno == ENODEV) return unplugged(errno);
  return deviceFault(DeviceFaultKind::kFailed, errno, "write");
}

DeviceFault SerialPort::write(std::span<const std::uint8_t> bytes, Duration most) {
  const Stamp until = monotonicNow() + most;
  // Bounded: each turn sends at least one byte, waits, or ends.
  while (!bytes.empty()) {
    std::size_t taken = 0;
    if (const DeviceFault fault = writeSome(bytes, taken); !fault.ok()) return fault;
    bytes = bytes.subspan(taken);
    if (taken > 0) continue;
    const Duration left = until - monotonicNow();
    if (left <= Duration{})
      return deviceFault(DeviceFaultKind::kFailed, 0, "%zu bytes not accepted in time", bytes.size());
    pollfd asked = {descriptor_, POLLOUT, 0};
    if (::poll(&asked, 1, pollMilliseconds(left)) > 0 && (asked.revents & POLLHUP) != 0) return unplugged(0);
  }
  return {};
}

std::optional<SerialErrors> SerialPort::errors() const {
  serial_icounter_struct counts = {};
  if (descriptor_ < 0 || ioctl(descriptor_, TIOCGICOUNT, &counts) != 0) return {};
  return SerialErrors{static_cast<std::uint32_t>(counts.overrun), static_cast<std::uint32_t>(counts.frame),
                      static_cast<std::uint32_t>(counts.parity),
                      static_cast<std::uint32_t>(counts.buf_overrun)};
}

}  // namespace swiftlet
