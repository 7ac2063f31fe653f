#pragma once
// The live view of a run (docs/view.md): takes the newest of it, from a low thread of its own at its own
// pace, and serves it. It reads a LiveOutlet; nobody waits for it. In builds without cpp-httplib the
// constructor says so.

#include <string>

#include "estimator/camera/rig.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

class ViewThread : public Follower {
 public:
  /// Listens and begins. std::runtime_error naming --view where the address cannot be had. `outlet` outlives
  /// it. `name`: what the page calls the run. Its end tells the viewers, and takes a second at most. `rig`:
  /// the cameras in use, whose images are shown where the outlet has them.
  ViewThread(LiveOutlet& outlet, const ViewAddress& address, const std::string& name, const Rig& rig);

  /// "http://127.0.0.1:8320/", with the port that it has got, and the token where one is needed.
  [[nodiscard]] std::string url() const;

 private:
  class Work;
};

}  // namespace swiftlet
