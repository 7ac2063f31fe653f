#include "firmware_host/interfaces/link_port.hpp"

#include <linux/filter.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::string_view kUdp = "udp:";
constexpr std::int64_t kNanosecondsPerMillisecond = 1'000'000;
/// Most datagrams from other senders that one read discards: about 30 us of work.
constexpr int kMostForeign = 16;

/// First bytes of MAVLink frames, versions 1 and 2.
constexpr std::uint8_t kFrameBegin1 = 0xFE;
constexpr std::uint8_t kFrameBegin2 = 0xFD;

std::uint16_t portOf(std::string_view text, std::string_view device, const char* setting) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size() || port == 0) {
    throw InputError("settings", 0, setting, std::string(device) + ": the port must be 1 to 65535",
                     "Write udp:HOST:PORT, for example udp:192.168.1.10:14550");
  }
  return port;
}

/// Makes the kernel drop datagrams from other hosts, or other ports of the host, before they wake a thread or
/// fill the buffer. If it cannot, read() drops them.
void takeOnlyFrom(int socket, const sockaddr_in& sender, bool any_port) {
  constexpr std::uint32_t kSourceAddress = 12;  // in the IPv4 header
  constexpr std::uint32_t kSourcePort = 0;      // in the UDP header, where the filter's offsets begin
  std::array<sock_filter, 6> program = {
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS,
                           static_cast<std::uint32_t>(SKF_NET_OFF) + kSourceAddress),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ntohl(sender.sin_addr.s_addr), 0, 3),
      sock_filter BPF_STMT(BPF_LD | BPF_H | BPF_ABS, kSourcePort),
      sock_filter BPF_JUMP(BPF_JMP | (any_port ? BPF_JGE : BPF_JEQ) | BPF_K,
                           any_port ? 0U : ntohs(sender.sin_port), 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, 0xFFFFFFFF),
      sock_filter BPF_STMT(BPF_RET | BPF_K, 0)};
  const sock_fprog filter = {static_cast<unsigned short>(program.size()), program.data()};
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)));
}

}  // namespace

std::optional<UdpAddress> udpAddress(std::string_view device, const char* setting) {
  if (!device.starts_with(kUdp)) return std::nullopt;
  std::string_view rest = device.substr(kUdp.size());
  UdpAddress address;
  if (const auto at = rest.rfind('@'); at != std::string_view::npos) {
    address.own_port = portOf(rest.substr(at + 1), device, setting);
    rest = rest.substr(0, at);
  }
  const auto colon = rest.rfind(':');
  address.port = portOf(colon == std::string_view::npos ? "" : rest.substr(colon + 1), device, setting);
  address.host = rest.substr(0, colon);
  if (address.host.empty()) {
    throw InputError("settings", 0, setting, std::string(device) + ": the host is missing",
                     "Write udp:HOST:PORT, for example udp:192.168.1.10:14550");
  }
  return address;
}

bool samePort(const std::string& a, const std::string& b) {
  if (a == b) return true;
  // std::filesystem::equivalent does not compare devices. A missing port is reported when it is opened.
  struct stat of_a = {}, of_b = {};
  if (::stat(a.c_str(), &of_a) != 0 || ::stat(b.c_str(), &of_b) != 0) return false;
  return S_ISCHR(of_a.st_mode) && S_ISCHR(of_b.st_mode) && of_a.st_rdev == of_b.st_rdev;
}

LinkPort::LinkPort(const std::string& device, unsigned baud, const char* setting)
    : udp_(udpAddress(device, setting)), serial_(SerialSettings{device, baud}) {}

void LinkPort::close() {
  serial_.close();
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  kept_begin_ = kept_end_ = 0;
}

DeviceFault LinkPort::open() {
  close();
  return udp_ ? openUdp() : serial_.open();
}

DeviceFault LinkPort::openUdp() {
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
  // Without an agreed port, the other side learns our port from our datagrams and answers from the port they
  // go to. To an agreed port, it may send from any port. The socket is not connected, which would fix our
  // address: each datagram takes the route that there is.
  takeOnlyFrom(socket_, peer_, udp_->own_port != 0);
  sockaddr_in own = {};
  own.sin_family = AF_INET;
  own.sin_port = htons(udp_->own_port);
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) != 0) {
    return deviceFault(errno == EADDRINUSE ? DeviceFaultKind::kBusy : DeviceFaultKind::kFailed, errno,
                       "UDP port %d", udp_->own_port);
  }
  return {};
}

std::uint16_t LinkPort::ownPort() const {
  sockaddr_in own = {};
  socklen_t length = sizeof(own);
  if (::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &length) != 0) return 0;
  return ntohs(own.sin_port);
}

void LinkPort::wait(Duration most) {
  pollfd asked = {descriptor(), POLLIN, 0};
  static_cast<void>(::poll(&asked, 1, static_cast<int>(most.ns / kNanosecondsPerMillisecond)));
}

DeviceFault LinkPort::read(std::span<std::uint8_t> into, std::size_t& count, Stamp& read_at) {
  if (!udp_) return serial_.read(into, count, read_at);
  count = 0;
  for (int i = 0; i <= kMostForeign; ++i) {
    sockaddr_in sender = {};
    socklen_t length = sizeof(sender);
    const ssize_t got =
        ::recvfrom(socket_, into.data(), into.size(), 0, reinterpret_cast<sockaddr*>(&sender), &length);
    read_at = monotonicNow();
    if (got < 0) break;
    const bool other_port = udp_->own_port == 0 && sender.sin_port != peer_.sin_port;
    if (got == 0 || other_port || sender.sin_addr.s_addr != peer_.sin_addr.s_addr) continue;
    count = static_cast<std::size_t>(got);
    if (into[0] == kFrameBegin1 || into[0] == kFrameBegin2) peer_.sin_port = sender.sin_port;
    break;
  }
  return {};
}

bool LinkPort::flush() {
  std::size_t taken = 1;
  // Each pass sends at least one byte, or is the last.
  while (kept_begin_ < kept_end_ && taken > 0) {
    const auto rest = std::span<const std::uint8_t>(kept_).subspan(kept_begin_, kept_end_ - kept_begin_);
    if (!serial_.writeSome(rest, taken).ok()) return false;
    kept_begin_ += taken;
  }
  return kept_begin_ == kept_end_;
}

DeviceFault LinkPort::write(std::span<const std::uint8_t> bytes) {
  if (udp_) return sendDatagram(bytes);
  if (bytes.size() > kept_.size()) return deviceFault(DeviceFaultKind::kFailed, 0, "the message is too long");
  if (!serial_.isOpen()) return deviceFault(DeviceFaultKind::kUnplugged, 0, "the port is closed");
  if (!flush()) {
    if (!serial_.isOpen()) return deviceFault(DeviceFaultKind::kUnplugged, 0, "during a write");
    return deviceFault(DeviceFaultKind::kFailed, 0, "%zu bytes are waiting to be sent",
                       kept_end_ - kept_begin_);
  }
  std::copy(bytes.begin(), bytes.end(), kept_.begin());
  kept_begin_ = 0;
  kept_end_ = bytes.size();
  static_cast<void>(flush());
  return serial_.isOpen() ? DeviceFault{} : deviceFault(DeviceFaultKind::kUnplugged, 0, "during a write");
}

DeviceFault LinkPort::sendDatagram(std::span<const std::uint8_t> bytes) {
  const ssize_t sent = ::sendto(socket_, bytes.data(), bytes.size(), 0,
                                reinterpret_cast<const sockaddr*>(&peer_), sizeof(peer_));
  if (sent == static_cast<ssize_t>(bytes.size())) return {};
  return deviceFault(DeviceFaultKind::kFailed, errno, "the datagram was not accepted");
}

}  // namespace swiftlet
