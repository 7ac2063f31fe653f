#include "firmware_host/outputs/view/view_address.hpp"

#include <arpa/inet.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr int kMostPort = 65535;

std::optional<int> portOf(std::string_view text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port < 0 || port > kMostPort) return {};
  return port;
}

bool isNumbers(const std::string& host) {
  in6_addr ignored{};
  return inet_pton(AF_INET, host.c_str(), &ignored) == 1 || inet_pton(AF_INET6, host.c_str(), &ignored) == 1;
}

struct HostAndPort {
  std::string host;
  std::string port;  ///< without the colon; empty: not given
};

/// Splits at the last colon; the brackets of "[IPV6]:PORT" are removed.
HostAndPort split(const std::string& text) {
  if (text.starts_with('[')) {
    const std::size_t end = text.find(']');
    if (end == std::string::npos) return {text, ""};
    const std::string rest = text.substr(end + 1);
    return {text.substr(1, end - 1), rest.starts_with(':') ? rest.substr(1) : rest};
  }
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || text.find(':') != colon) return {text, ""};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c; });
  return text;
}

std::string ownName() {
  constexpr std::size_t kMostName = 256;
  std::array<char, kMostName> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? lower(name.data()) : "";
}

}  // namespace

std::string ViewAddress::text() const {
  const bool six = host.find(':') != std::string::npos;
  return (six ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

bool ViewAddress::isLoopback() const {
  in_addr four{};
  if (inet_pton(AF_INET, host.c_str(), &four) == 1) return (ntohl(four.s_addr) >> 24U) == IN_LOOPBACKNET;
  in6_addr six{};
  if (inet_pton(AF_INET6, host.c_str(), &six) == 1) return IN6_IS_ADDR_LOOPBACK(&six);
  return host == "localhost";
}

ViewAddress parseViewAddress(const std::string& text) {
  ViewAddress address;
  if (text.empty()) return address;
  if (const auto port = portOf(text)) {
    address.port = *port;
    return address;
  }
  const HostAndPort parts = split(text);
  const auto port = parts.port.empty() ? std::optional<int>(kViewPort) : portOf(parts.port);
  const std::string host = parts.host.empty() ? address.host : parts.host;
  if (!port || (!isNumbers(host) && host != "localhost")) {
    throw InputError(
        "--view", 0, text, "is no ADDRESS:PORT",
        "Give an address of this host in numbers and a port from 0 to 65535, as in --view 127.0.0.1:" +
            std::to_string(kViewPort) + ", or --view alone as the last option");
  }
  address.host = host;
  address.port = *port;
  return address;
}

bool viewMayAnswer(const ViewAddress& address, const std::string& host, const std::string& origin) {
  if (!origin.empty() && lower(origin) != "http://" + lower(host)) return false;
  const std::string name = lower(split(host).host);
  if (isNumbers(name) || name == "localhost" || name == lower(address.host)) return true;
  const std::string own = ownName();
  return !own.empty() && (name == own || name == own + ".local");
}

}  // namespace swiftlet
