#pragma once
// The live view's web server: the page, and the stream of a ViewHub as Server-Sent Events (docs/view.md).
//
// GET / is the page, /stream the events, /text the newest figures as text, /moment a moment of a finished
// run. Everything else is refused; beyond loopback, so are these without the token. A connection carries one
// request of at most some kilobytes, which must arrive within seconds, and ends with its answer. Every write
// gives up on a reader that takes nothing for kPatience. The server's end waits for nobody.
//
// Threads: one that accepts and kWorkers that answer, all SCHED_OTHER with raised niceness, none on the
// flight path. Memory: their stacks, and one request each. In builds without cpp-httplib the constructor
// throws an error that says so (no_view_server.cpp).

#include <functional>
#include <memory>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/outputs/view/view_hub.hpp"

namespace swiftlet {

struct ViewPages {
  // Called on any of the answering threads.
  std::function<std::string()> page;  ///< HTML of GET /
  std::function<std::string()> text;  ///< newest figures
  /// JSON for GET /moment?i=N of a finished run; empty: there is no such moment, or no moments at all.
  std::function<std::string(std::size_t moment)> moment = {};
};

class ViewServer {
 public:
  static constexpr double kPatience = 10;  ///< s
  /// One for each viewer, and some for pages and for refusals.
  static constexpr std::size_t kWorkers = ViewHub::kMostViewers + 4;

  /// Starts listening and answering. std::runtime_error naming --view if the address is not available. `hub`
  /// outlives this object.
  ViewServer(ViewHub& hub, const ViewAddress& address, ViewPages pages);
  /// Ends the server: within half a second, viewers that keep up get what is queued for them, and the end.
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// The address with the actual port.
  [[nodiscard]] const ViewAddress& address() const;
  /// URL of the page, including the token if one is required (view_token.hpp).
  [[nodiscard]] std::string url() const;

  class Work;

 private:
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
