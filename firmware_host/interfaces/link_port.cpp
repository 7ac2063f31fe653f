#include "firmware_host/outputs/autopilot/autopilot_port.hpp"

#include <linux/filter.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>

#include "drivers/calibration/input_error.hpp"
#include "drivers/device/monotonic_now.hpp"

namespace swiftlet {
namespace {

constexpr std::string_view kUdp = "udp:";
constexpr std::int64_t kNanosecondsPerMillisecond = 1'000'000;
/// Datagrams of others that one read passes over: some 30 us of work.
constexpr int kMostForeign = 16;

std::uint16_t portOf(std::string_view text, std::string_view device) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size() || port == 0) {
    throw InputError("settings", 0, "autopilot.device", std::string(device) + ": no port from 1 to 65535",
                     "Write udp:HOST:PORT, as udp:192.168.1.10:14550");
  }
  return port;
}

/// The kernel drops datagrams of other hosts before they wake anybody or fill the buffer. Where it cannot,
/// they are dropped as they are read.
void takeOnlyFrom(int socket, in_addr_t host) {
  constexpr std::uint32_t kSourceAddress = 12;  // in the IPv4 header
  std::array<sock_filter, 4> program = {
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS,
                           static_cast<std::uint32_t>(SKF_NET_OFF) + kSourceAddress),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ntohl(host), 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, 0xFFFFFFFF), sock_filter BPF_STMT(BPF_RET | BPF_K, 0)};
  const sock_fprog filter = {static_cast<unsigned short>(program.size()), program.data()};
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)));
}

/// What is not there is said when it is opened. (std::filesystem::equivalent does not compare devices.)
bool sameNode(const std::string& a, const std::string& b) {
  struct stat of_a = {}, of_b = {};
  if (::stat(a.c_str(), &of_a) != 0 || ::stat(b.c_str(), &of_b) != 0) return false;
  return S_ISCHR(of_a.st_mode) && S_ISCHR(of_b.st_mode) && of_a.st_rdev == of_b.st_rdev;
}

}  // namespace

std::optional<UdpAddress> udpAddress(std::string_view device) {
  if (!device.starts_with(kUdp)) return std::nullopt;
  std::string_view rest = device.substr(kUdp.size());
  UdpAddress address;
  if (const auto at = rest.rfind('@'); at != std::string_view::npos) {
    address.own_port = portOf(rest.substr(at + 1), device);
    rest = rest.substr(0, at);
  }
  const auto colon = rest.rfind(':');
  address.port = portOf(colon == std::string_view::npos ? "" : rest.substr(colon + 1), device);
  address.host = rest.substr(0, colon);
  if (address.host.empty()) {
    throw InputError("settings", 0, "autopilot.device", std::string(device) + ": no host",
                     "Write udp:HOST:PORT, as udp:192.168.1.10:14550");
  }
  return address;
}

void checkOwnPort(const std::string& device, const std::string& imu_device) {
  if (device != imu_device && !sameNode(device, imu_device)) return;
  throw InputError("settings", 0, "autopilot.device", device + " is the IMU's port, imu_link.device",
                   "Give the autopilot a port of its own (two of its MAVLink ports, or one and UDP)");
}

AutopilotPort::AutopilotPort(const std::string& device, unsigned baud)
    : udp_(udpAddress(device)), serial_(SerialSettings{device, baud}) {}

void AutopilotPort::close() {
  serial_.close();
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

DeviceFault AutopilotPort::open() {
  close();
  return udp_ ? openUdp() : serial_.open();
}

DeviceFault AutopilotPort::openUdp() {
  if (!peer_known_) {
    addrinfo wanted = {};
    wanted.ai_family = AF_INET;
    wanted.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    if (const int error = getaddrinfo(udp_->host.c_str(), nullptr, &wanted, &found); error != 0) {
      return deviceFault(DeviceFaultKind::kMissing, 0, "host %s: %s", udp_->host.c_str(),
                         gai_strerror(error));
    }
    peer_ = *reinterpret_cast<const sockaddr_in*>(found->ai_addr);
    peer_.sin_port = htons(udp_->port);
    freeaddrinfo(found);
    peer_known_ = true;
  }
  socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return openFault(errno, "UDP socket");
  takeOnlyFrom(socket_, peer_.sin_addr.s_addr);
  sockaddr_in own = {};
  own.sin_family = AF_INET;
  own.sin_port = htons(udp_->own_port);
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) != 0) {
    return deviceFault(errno == EADDRINUSE ? DeviceFaultKind::kBusy : DeviceFaultKind::kFailed, errno,
                       "UDP port %d", udp_->own_port);
  }
  // Whoever hears of our port by our datagrams answers from where they go to. An agreed port is sent to from
  // any.
  if (udp_->own_port == 0 &&
      ::connect(socket_, reinterpret_cast<const sockaddr*>(&peer_), sizeof(peer_)) != 0) {
    return openFault(errno, "UDP socket");
  }
  return {};
}

std::uint16_t AutopilotPort::ownPort() const {
  sockaddr_in own = {};
  socklen_t length = sizeof(own);
  if (::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &length) != 0) return 0;
  return ntohs(own.sin_port);
}

void AutopilotPort::wait(Duration most) {
  pollfd asked = {udp_ ? socket_ : serial_.descriptor(), POLLIN, 0};
  static_cast<void>(::poll(&asked, 1, static_cast<int>(most.ns / kNanosecondsPerMillisecond)));
}

DeviceFault AutopilotPort::read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at) {
  if (!udp_) return serial_.read(into, count, read_at);
  count = 0;
  for (int i = 0; i <= kMostForeign; ++i) {
    sockaddr_in sender = {};
    socklen_t length = sizeof(sender);
    const ssize_t got =
        ::recvfrom(socket_, into.data(), into.size(), 0, reinterpret_cast<sockaddr*>(&sender), &length);
    read_at = monotonicNow();
    // An autopilot that is not up yet answers our datagrams by ICMP: no fault, and no end of what waits.
    if (got < 0 && errno != ECONNREFUSED) break;
    if (got <= 0 || sender.sin_addr.s_addr != peer_.sin_addr.s_addr) continue;
    count = static_cast<std::size_t>(got);
    break;
  }
  return {};
}

DeviceFault AutopilotPort::write(std::span<const std::uint8_t> bytes) {
  if (!udp_) return serial_.write(bytes, Duration{});
  const auto send = [&] {
    return ::sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&peer_),
                    sizeof(peer_));
  };
  ssize_t sent = send();
  // The answer to an earlier datagram: nobody was there. This one has not been tried yet.
  if (sent < 0 && errno == ECONNREFUSED) sent = send();
  if (sent == static_cast<ssize_t>(bytes.size()) || errno == ECONNREFUSED) return {};
  return deviceFault(DeviceFaultKind::kFailed, errno, "datagram not taken");
}

}  // namespace swiftlet
