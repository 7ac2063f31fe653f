#pragma once
// The live view of a run (docs/view.md): a low-priority thread of its own takes the run's newest values at
// its own pace and serves them. It reads a LiveOutlet; nobody waits for it. In builds without cpp-httplib the
// constructor throws an error that says so.

#include <string>

#include "estimator/camera/rig.hpp"
#include "firmware_host/interfaces/follower_thread.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

class ViewThread : public Follower {
 public:
  /// Starts listening. std::runtime_error naming --view if the address is not available. `outlet` outlives
  /// this object. `name`: the run's name on the page. `rig`: the cameras in use, whose images are shown if
  /// the outlet has them. Ending it notifies the viewers and takes at most a second.
  ViewThread(LiveOutlet& outlet, const ViewAddress& address, const std::string& name, const Rig& rig);

  /// "http://127.0.0.1:8320/" with the actual port, and the token if one is required.
  [[nodiscard]] std::string url() const;

 private:
  class Work;
};

}  // namespace swiftlet
