// EdgeSource through libgpiod 1.6, for kernels without v2 line events.
#include <fcntl.h>
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/gpio/edge_source.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kAtOnce = 16;
constexpr const char* kConsumer = "swiftlet";
constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t nanoseconds(const timespec& t) {
  return static_cast<std::int64_t>(t.tv_sec) * kSecond + t.tv_nsec;
}

/// Whether a stamp is in CLOCK_REALTIME, as of kernels before 5.7: it is decades ahead of CLOCK_MONOTONIC.
bool inRealtime(Stamp stamp) { return stamp > monotonicNow() + Duration{kSecond}; }

}  // namespace

bool EdgeSource::hasLibgpiod() { return true; }

DeviceFault EdgeSource::openLibgpiod(const std::string& path, std::uint32_t offset, EdgeKind edges) {
  chip_ = gpiod_chip_open(path.c_str());
  if (chip_ == nullptr) return deviceFault(DeviceFaultKind::kFailed, errno, "opening with libgpiod");
  interface_ = EdgeInterface::kLibgpiod;
  line_ = gpiod_chip_get_line(chip_, offset);
  int result = -1;
  if (line_ != nullptr && edges == EdgeKind::kRising)
    result = gpiod_line_request_rising_edge_events(line_, kConsumer);
  if (line_ != nullptr && edges == EdgeKind::kFalling)
    result = gpiod_line_request_falling_edge_events(line_, kConsumer);
  if (line_ != nullptr && edges == EdgeKind::kBoth)
    result = gpiod_line_request_both_edges_events(line_, kConsumer);
  if (result == 0) fd_ = gpiod_line_event_get_fd(line_);
  const int flags = fd_ < 0 ? -1 : fcntl(fd_, F_GETFL);
  if (flags < 0 || fcntl(fd_, F_SETFL, flags | O_NONBLOCK) != 0) {
    const int error = errno;
    close();
    return deviceFault(DeviceFaultKind::kFailed, error, "libgpiod's line request");
  }
  return {};
}

void EdgeSource::closeLibgpiod() {
  if (chip_ != nullptr) gpiod_chip_close(chip_);  // releases the line, too
  chip_ = nullptr;
  line_ = nullptr;
}

DeviceFault EdgeSource::readLibgpiod(std::span<EdgeEvent> out, std::size_t& count) {
  std::array<gpiod_line_event, kAtOnce> events;
  while (count < out.size()) {
    const auto wanted = static_cast<unsigned>(std::min(kAtOnce, out.size() - count));
    const int got = gpiod_line_event_read_multiple(line_, events.data(), wanted);
    if (got < 0 && errno == EINTR) return {};
    if (got < 0 && errno == EAGAIN) return gone();
    if (got < 0) {
      const DeviceFaultKind kind = errno == ENODEV ? DeviceFaultKind::kUnplugged : DeviceFaultKind::kFailed;
      return deviceFault(kind, errno, "reading edges");
    }
    for (int i = 0; i < got; ++i) {
      const gpiod_line_event& e = events[static_cast<std::size_t>(i)];
      const Stamp stamp = {nanoseconds(e.ts)};
      if (inRealtime(stamp)) {
        return deviceFault(DeviceFaultKind::kUnsupported, 0,
                           "this kernel stamps edges in real time: use 5.7 or newer");
      }
      out[count++] = {stamp, e.event_type == GPIOD_LINE_EVENT_RISING_EDGE, std::nullopt};
    }
    if (static_cast<unsigned>(got) < wanted) return {};
  }
  return {};
}

}  // namespace swiftlet
