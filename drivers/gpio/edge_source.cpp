#include "drivers/gpio/edge_source.hpp"

#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>

#include "drivers/gpio/gpio_chip.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kAtOnce = 16;  // events per system call: 768 bytes on the stack
constexpr const char* kConsumer = "swiftlet";

DeviceFault requestFault(int error, const GpioLine& line) {
  if (error == EBUSY) {
    return deviceFault(DeviceFaultKind::kBusy, error, "line %u is held by %s", line.offset,
                       line.consumer.empty() ? "an unnamed user" : line.consumer.c_str());
  }
  if (error == ENXIO || error == EOPNOTSUPP) {
    return deviceFault(DeviceFaultKind::kUnsupported, error,
                       "line %u does not support interrupts: use another line", line.offset);
  }
  if (error == ENODEV) return deviceFault(DeviceFaultKind::kUnplugged, error, "line %u", line.offset);
  return openFault(error, "requesting the edges of line " + std::to_string(line.offset));
}

}  // namespace

DeviceFault EdgeSource::open(const EdgeSourceSettings& settings) {
  close();
  GpioChip chip;
  GpioLine line;
  DeviceFault fault = chip.open(settings.chip);
  if (fault.ok()) fault = chip.findLine(settings.line, line);
  if (!fault.ok()) return fault;
  if (settings.interface == EdgeInterface::kLibgpiod && !hasLibgpiod()) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0, "built without libgpiod");
  }
  gaps_ = EdgeGaps(settings.edges == EdgeKind::kBoth ? Duration{} : settings.period);
  if (settings.interface != EdgeInterface::kLibgpiod) {
    fault = openKernel(chip.fd(), line.offset, settings);
    // Errors of a kernel that does not know the call.
    const bool unknown = fault.error == ENOTTY || fault.error == EINVAL;
    const bool other = settings.interface == EdgeInterface::kAny && hasLibgpiod() && unknown;
    if (!other) return fault.ok() ? fault : requestFault(fault.error, line);
  }
  fault = openLibgpiod(chip.path(), line.offset, settings.edges);
  return fault.ok() ? fault : requestFault(fault.error, line);
}

void EdgeSource::close() {
  if (interface_ == EdgeInterface::kLibgpiod) {
    closeLibgpiod();
  } else if (fd_ >= 0) {
    ::close(fd_);
  }
  fd_ = -1;
  interface_ = EdgeInterface::kAny;
}

DeviceFault EdgeSource::openKernel(int chip, std::uint32_t offset, const EdgeSourceSettings& settings) {
  gpio_v2_line_request request{};
  request.offsets[0] = offset;
  request.num_lines = 1;
  request.event_buffer_size = settings.buffer;
  std::snprintf(request.consumer, sizeof request.consumer, "%s", kConsumer);
  // Without a flag for another clock the kernel stamps with CLOCK_MONOTONIC.
  request.config.flags = GPIO_V2_LINE_FLAG_INPUT;
  if (settings.edges != EdgeKind::kFalling) request.config.flags |= GPIO_V2_LINE_FLAG_EDGE_RISING;
  if (settings.edges != EdgeKind::kRising) request.config.flags |= GPIO_V2_LINE_FLAG_EDGE_FALLING;
  if (ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request) != 0) {
    return deviceFault(DeviceFaultKind::kFailed, errno, "v2 line request");
  }
  fd_ = request.fd;
  interface_ = EdgeInterface::kKernel;
  const int flags = fcntl(fd_, F_GETFL);
  if (flags < 0 || fcntl(fd_, F_SETFL, flags | O_NONBLOCK) != 0) {
    const int error = errno;
    close();
    return deviceFault(DeviceFaultKind::kFailed, error, "making the line's events non-blocking");
  }
  return {};
}

DeviceFault EdgeSource::gone() const {
  // No data: older kernels report a removed chip only through poll().
  pollfd p{fd_, POLLIN, 0};
  if (poll(&p, 1, 0) > 0 && (p.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) {
    return deviceFault(DeviceFaultKind::kUnplugged, ENODEV, "the GPIO chip was removed");
  }
  return {};
}

DeviceFault EdgeSource::read(std::span<EdgeEvent> out, std::size_t& count) {
  count = 0;
  if (fd_ < 0) return deviceFault(DeviceFaultKind::kMissing, 0, "not open");
  const DeviceFault fault =
      interface_ == EdgeInterface::kLibgpiod ? readLibgpiod(out, count) : readKernel(out, count);
  for (std::size_t i = 0; i < count; ++i) missed_ += gaps_.add(out[i]);
  edges_ += count;
  return fault;
}

DeviceFault EdgeSource::readKernel(std::span<EdgeEvent> out, std::size_t& count) {
  std::array<gpio_v2_line_event, kAtOnce> events;
  while (count < out.size()) {
    const std::size_t wanted = std::min(kAtOnce, out.size() - count);
    const ssize_t got = ::read(fd_, events.data(), wanted * sizeof events[0]);
    if (got < 0 && errno == EINTR) return {};
    if (got < 0 && errno == EAGAIN) return gone();
    if (got < 0) {
      const DeviceFaultKind kind = errno == ENODEV ? DeviceFaultKind::kUnplugged : DeviceFaultKind::kFailed;
      return deviceFault(kind, errno, "reading edges");
    }
    const std::size_t taken = static_cast<std::size_t>(got) / sizeof events[0];
    for (std::size_t i = 0; i < taken; ++i) {
      const gpio_v2_line_event& e = events[i];
      out[count++] = {
          {static_cast<std::int64_t>(e.timestamp_ns)}, e.id == GPIO_V2_LINE_EVENT_RISING_EDGE, e.line_seqno};
    }
    if (taken < wanted) return {};
  }
  return {};
}

}  // namespace swiftlet
