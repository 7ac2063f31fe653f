#include "drivers/can/can_bus.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace swiftlet {
namespace {

constexpr int kErrorFramesPerCall = 16;
// A stamp older than this when it is read, or later than the reading, was taken before the wall clock was
// stepped.
constexpr Duration kOldest = Duration::fromMilliseconds(10'000);
constexpr can_err_mask_t kErrors =
    CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_CRTL | CAN_ERR_TX_TIMEOUT | CAN_ERR_ACK;

Stamp stampOf(const timespec& time) { return {time.tv_sec * 1'000'000'000 + time.tv_nsec}; }

/// Ancillary data of a frame.
struct Beside {
  std::optional<Stamp> software;  ///< CLOCK_REALTIME
  std::optional<std::uint32_t> lost;
};

Beside readControl(msghdr& message) {
  Beside beside;
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET) continue;
    if (part->cmsg_type == SCM_TIMESTAMPING) {
      // Order: software, deprecated, raw hardware.
      std::array<timespec, 3> stamps = {};
      std::memcpy(stamps.data(), CMSG_DATA(part), sizeof(stamps));
      if (stampOf(stamps[0]).ns != 0) beside.software = stampOf(stamps[0]);
    } else if (part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t lost = 0;
      std::memcpy(&lost, CMSG_DATA(part), sizeof(lost));
      beside.lost = lost;
    }
  }
  return beside;
}

CanFrame frameOf(const canfd_frame& raw, bool fd) {
  CanFrame frame;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.fast_data = fd && (raw.flags & CANFD_BRS) != 0;
  frame.size = std::min<std::uint8_t>(raw.len, fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
  std::copy_n(raw.data, frame.size, frame.data.begin());
  return frame;
}

/// Copies the interface's name, not too long, into a request; false if the name is empty.
bool nameOf(const CanBusSettings& settings, ifreq& request) {
  std::copy_n(settings.interface.data(), sizeof(request.ifr_name), request.ifr_name);
  return request.ifr_name[0] != '\0';
}

}  // namespace

void CanBusSettings::setInterface(const char* name) {
  std::snprintf(interface.data(), interface.size(), "%s", name);
}

void CanBusSettings::addFilter(CanFilter filter) {
  if (filter_count < filters.size()) filters[filter_count++] = filter;
}

DeviceFault CanBusSettings::nameFault() const {
  if (std::strlen(interface.data()) < IFNAMSIZ) return {};
  return deviceFault(DeviceFaultKind::kMissing, 0,
                     "no network interface %s: names have at most %d characters; `ip -br link` lists the "
                     "available ones",
                     interface.data(), IFNAMSIZ - 1);
}

DeviceFault CanBus::interfaceFault(int error) const {
  const char* name = settings_.interface.data();
  const bool virtual_bus = std::strncmp(name, "vcan", 4) == 0;
  switch (error) {
    case ENODEV:
      return deviceFault(DeviceFaultKind::kMissing, 0,
                         "no network interface %s: `ip -br link` lists the available ones", name);
    case ENETDOWN:
      return deviceFault(DeviceFaultKind::kDown, 0, "`ip link set %s up%s`", name,
                         virtual_bus ? "" : " type can bitrate 1000000 restart-ms 100");
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
      return deviceFault(DeviceFaultKind::kUnsupported, error, "this kernel has no CAN: `modprobe can_raw`");
    default:
      return openFault(error, name);
  }
}

DeviceFault CanBus::open(const CanBusSettings& settings) {
  close();
  settings_ = settings;
  warning_ = {};
  if (const DeviceFault fault = settings_.nameFault(); !fault.ok()) return fault;
  fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd_ < 0) return interfaceFault(errno);
  const DeviceFault fault = setUp();
  if (!fault.ok()) close();
  return fault;
}

DeviceFault CanBus::reopen() {
  const CanBusSettings same = settings_;
  DeviceFault fault = open(same);
  if (fault.ok()) ++counters_.reopened;
  return fault;
}

void CanBus::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  down_ = false;
  bus_off_ = false;
  takes_fd_ = false;
  lost_seen_ = 0;
}

bool CanBus::interfaceIsUp() const {
  ifreq request = {};
  nameOf(settings_, request);
  return ::ioctl(fd_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
}

DeviceFault CanBus::setUp() {
  ifreq request = {};
  if (!nameOf(settings_, request) || ::ioctl(fd_, SIOCGIFINDEX, &request) != 0) return interfaceFault(ENODEV);
  sockaddr_can address = {};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (!interfaceIsUp()) return interfaceFault(ENETDOWN);
  takes_fd_ = ::ioctl(fd_, SIOCGIFMTU, &request) == 0 && request.ifr_mtu >= static_cast<int>(CANFD_MTU);
  if (settings_.fd && !takes_fd_) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "supports classic frames only: `ip link set %s down`, then `ip link set %s up type "
                       "can bitrate 1000000 dbitrate 4000000 fd on restart-ms 100`",
                       settings_.interface.data(), settings_.interface.data());
  }

  std::array<can_filter, 4> filters = {};
  for (std::size_t i = 0; i < settings_.filter_count; ++i) {
    filters[i] = {settings_.filters[i].id | CAN_EFF_FLAG, settings_.filters[i].mask | CAN_EFF_FLAG};
  }
  const auto set = [this](int level, int option, const void* value, std::size_t size) {
    return ::setsockopt(fd_, level, option, value, static_cast<socklen_t>(size)) == 0;
  };
  const int on = 1;
  const int stamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  bool ok = set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &kErrors, sizeof(kErrors)) &&
            set(SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof(stamps)) &&
            set(SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on));
  if (settings_.filter_count > 0) {
    ok = ok && set(SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), settings_.filter_count * sizeof(can_filter));
  }
  if (takes_fd_) ok = ok && set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on));
  if (!ok) return deviceFault(DeviceFaultKind::kFailed, errno, "setting up the socket");

  // With the required capability the size can exceed net.core.rmem_max. The kernel doubles the value and
  // reports the doubled one.
  if (!set(SOL_SOCKET, SO_RCVBUFFORCE, &settings_.receive_buffer, sizeof(int))) {
    set(SOL_SOCKET, SO_RCVBUF, &settings_.receive_buffer, sizeof(int));
  }
  int given = 0;
  socklen_t size = sizeof(given);
  ::getsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &given, &size);
  if (given < settings_.receive_buffer / 4) {
    warning_ = deviceFault(DeviceFaultKind::kChanged, 0,
                           "receive buffer: requested %d KiB, got %d KiB; `sysctl -w net.core.rmem_max=%d`",
                           settings_.receive_buffer >> 10, given >> 10, settings_.receive_buffer);
  }
  if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return interfaceFault(errno);
  return {};
}

void CanBus::takeError(std::uint32_t id, std::span<const std::uint8_t> data) {
  ++counters_.error_frames;
  if ((id & CAN_ERR_BUSOFF) != 0) {
    ++counters_.bus_off;
    bus_off_ = true;
  }
  if ((id & CAN_ERR_RESTARTED) != 0) {
    ++counters_.restarts;
    bus_off_ = false;
  }
  if ((id & CAN_ERR_CRTL) != 0 && data.size() > 1) {
    if ((data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++counters_.controller_overflows;
    if ((data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) ++counters_.error_passive;
  }
}

DeviceFault CanBus::standing() {
  if (down_) {
    down_ = !interfaceIsUp();
    if (down_) return interfaceFault(ENETDOWN);
    bus_off_ = false;
  }
  if (bus_off_) {
    return deviceFault(
        DeviceFaultKind::kDown, 0,
        "bus-off after too many errors: check bit rate, wires and termination; `ip link set %s type "
        "can restart`, or set it up with restart-ms 100",
        settings_.interface.data());
  }
  return {};
}

DeviceFault CanBus::next(std::optional<CanFrame>& frame) {
  frame.reset();
  if (!isOpen())
    return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed; waiting for the device to return");
  for (int i = 0; i < kErrorFramesPerCall; ++i) {
    canfd_frame raw = {};
    iovec place = {&raw, sizeof(raw)};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(3 * sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))>
        control;
    msghdr message = {};
    message.msg_iov = &place;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(fd_, &message, MSG_DONTWAIT);
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) return standing();
      if (errno == ENETDOWN) {
        ++counters_.went_down;
        down_ = true;
        return standing();
      }
      const int error = errno;
      close();
      if (error == ENODEV)
        return deviceFault(DeviceFaultKind::kUnplugged, error, "the interface was removed");
      return deviceFault(DeviceFaultKind::kFailed, error, "reading the socket");
    }
    const bool fd = size == static_cast<ssize_t>(CANFD_MTU);
    if (!fd && size != static_cast<ssize_t>(CAN_MTU)) continue;
    const Beside beside = readControl(message);
    if (beside.lost) {
      counters_.lost_in_socket += *beside.lost - lost_seen_;
      lost_seen_ = *beside.lost;
    }
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      takeError(raw.can_id, {raw.data, std::min<std::size_t>(raw.len, CAN_MAX_DLEN)});
      continue;
    }
    if ((raw.can_id & CAN_RTR_FLAG) != 0) continue;
    bus_off_ = false;
    down_ = false;
    frame = frameOf(raw, fd);
    const HostClocks time = readHostClocks();
    clocks_ = clocks_ ? betterOf(*clocks_, time) : time;
    frame->arrival = time.monotonic;
    const Stamp stamped = beside.software.value_or(Stamp{}) - clocks_->realtime_ahead;
    const Duration age = time.monotonic - stamped;
    if (beside.software && age >= Duration{} - clocks_->error && age < kOldest) {
      frame->arrival = std::min(stamped, time.monotonic);
    } else {
      ++counters_.without_stamp;
    }
    ++counters_.frames;
    counters_.fd_frames += fd ? 1 : 0;
    return {};
  }
  return standing();
}

DeviceFault CanBus::send(const CanFrame& frame) {
  if (!isOpen()) return deviceFault(DeviceFaultKind::kUnplugged, 0, "closed");
  canfd_frame raw = {};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U);
  raw.len = frame.size;
  raw.flags = frame.fast_data ? CANFD_BRS : 0;
  if (frame.size > (frame.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN) || (frame.fd && !takes_fd_)) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "%s frames of %u bytes cannot be sent on this interface", frame.fd ? "FD" : "classic",
                       frame.size);
  }
  std::copy_n(frame.data.begin(), frame.size, raw.data);
  // struct can_frame and canfd_frame begin alike; the kernel tells them apart by length.
  if (::write(fd_, &raw, frame.fd ? CANFD_MTU : CAN_MTU) >= 0) {
    ++counters_.sent;
    return {};
  }
  if (errno == ENOBUFS || errno == EAGAIN)
    return deviceFault(DeviceFaultKind::kBusy, errno, "its queue is full");
  if (errno == ENETDOWN) return interfaceFault(ENETDOWN);
  return deviceFault(DeviceFaultKind::kFailed, errno, "sending a frame");
}

}  // namespace swiftlet
