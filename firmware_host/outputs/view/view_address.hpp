#pragma once
// Where the live view is served: an address of this host and a port, as `--view` takes them.

#include <string>

namespace swiftlet {

/// Where nobody names another port.
inline constexpr int kViewPort = 8320;

struct ViewAddress {
  std::string host = "127.0.0.1";
  int port = kViewPort;  ///< 0: any that is free

  /// "127.0.0.1:8320", "[::1]:8320".
  [[nodiscard]] std::string text() const;
  /// Only this host reaches it.
  [[nodiscard]] bool isLoopback() const;
};

/// "ADDRESS:PORT", "ADDRESS", "PORT", ":PORT", "[IPV6]:PORT"; empty: loopback and kViewPort. InputError
/// naming
/// --view.
ViewAddress parseViewAddress(const std::string& text);

/// Whether a request with these headers comes from a page of this server or from no page. A page from
/// elsewhere may reach the port under a name of its own that leads here: a name is taken only where it is
/// "localhost", this host's or the one of `address`. `origin` is empty where there is none.
bool viewMayAnswer(const ViewAddress& address, const std::string& host, const std::string& origin);

}  // namespace swiftlet
