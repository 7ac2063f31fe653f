#pragma once
// The live view's web server: the page, and the stream of a ViewHub as Server-Sent Events (docs/view.md).
//
// GET / is the page, /stream the events, /text the newest figures as text, /moment a moment of a finished
// run; all else is refused, and beyond loopback these too without the token. A connection has one request of
// at most some kilobytes, which has to be there within seconds, and ends with its answer. Every write gives
// up on a reader that takes nothing for kPatience; the end of the server waits for nobody.
//
// Threads: one that accepts and kWorkers that answer, all SCHED_OTHER and of raised niceness, none on the
//   flight path. Memory: their stacks, and one request each.
// In builds without cpp-httplib the constructor says so (no_view_server.cpp).

#include <functional>
#include <memory>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/outputs/view/view_hub.hpp"

namespace swiftlet {

struct ViewPages {
  // Called on any of the threads that answer.
  std::function<std::string()> page;  ///< HTML of GET /
  std::function<std::string()> text;  ///< newest figures
  /// JSON of GET /moment?i=N, of a run that is over; empty: there is no such moment, or no such thing.
  std::function<std::string(std::size_t moment)> moment = {};
};

class ViewServer {
 public:
  static constexpr double kPatience = 10;  ///< s
  /// One for each viewer, and some for pages and for those who are refused.
  static constexpr std::size_t kWorkers = ViewHub::kMostViewers + 4;

  /// Listens and answers from now on. std::runtime_error naming --view where the address cannot be had. `hub`
  /// outlives it.
  ViewServer(ViewHub& hub, const ViewAddress& address, ViewPages pages);
  /// Ends it: viewers that take what they are sent get what waits for them and the end, within half a second.
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// With the port that it has got.
  [[nodiscard]] const ViewAddress& address() const;
  /// Of the page, with the token where one is needed (view_token.hpp).
  [[nodiscard]] std::string url() const;

  class Work;

 private:
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
