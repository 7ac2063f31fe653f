#pragma once
// Where the live view is served: an address of this host and a port, as given by `--view`.

#include <string>

namespace swiftlet {

/// Default port.
inline constexpr int kViewPort = 8320;

struct ViewAddress {
  std::string host = "127.0.0.1";
  int port = kViewPort;  ///< 0: any free port

  /// "127.0.0.1:8320", "[::1]:8320".
  [[nodiscard]] std::string text() const;
  /// Whether only this host can reach it.
  [[nodiscard]] bool isLoopback() const;
};

/// "ADDRESS:PORT", "ADDRESS", "PORT", ":PORT", "[IPV6]:PORT"; empty: loopback and kViewPort. InputError
/// naming --view.
ViewAddress parseViewAddress(const std::string& text);

/// Whether a request with these headers comes from a page of this server or from no page. A foreign page may
/// reach the port under its own name that resolves to this host, so a name is accepted only if it is
/// "localhost", this host's name or that of `address`. `origin` is empty if the header is missing.
bool viewMayAnswer(const ViewAddress& address, const std::string& host, const std::string& origin);

}  // namespace swiftlet
