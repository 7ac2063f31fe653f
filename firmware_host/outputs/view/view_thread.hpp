#pragma once
// The live view of a run (docs/view.md): takes the newest of it, from a low thread of its own at its own
// pace, and serves it. It reads a LiveOutlet; nobody waits for it. In builds without cpp-httplib the
// constructor says so.

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

class ViewThread {
 public:
  /// Listens and begins. InputError naming --view where the address cannot be had. `outlet` outlives it.
  /// `name`: what the page calls the run.
  ViewThread(LiveOutlet& outlet, const ViewAddress& address, const std::string& name);
  /// Tells the viewers of the end, and ends: within a second. A thread that is stuck is left behind: `outlet`
  /// has to stay then.
  ~ViewThread();
  ViewThread(const ViewThread&) = delete;
  ViewThread& operator=(const ViewThread&) = delete;

  /// "http://127.0.0.1:8320/", with the port that it has got.
  [[nodiscard]] std::string url() const;
  /// For the supervisor; as long as this object.
  [[nodiscard]] const Heartbeat& heart() const;
  /// Tells it to end, and waits for nothing: so that several end at the same time.
  void tellEnd();
  /// Ends it, and gives what it counted, for the summary; `fault`: why it ended before, or that it is stuck.
  nlohmann::ordered_json finish();

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
