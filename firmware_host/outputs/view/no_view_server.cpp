// Replaces view_server.cpp in builds without cpp-httplib.

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/view/view_server.hpp"

namespace swiftlet {

class ViewServer::Work {
 public:
  ViewAddress address;
};

ViewServer::ViewServer(ViewHub& /*hub*/, const ViewAddress& /*address*/, ViewPages /*pages*/) {
  throw InputError("--view", 0, "", "this build has no live view",
                   "Install libcpp-httplib-dev and configure anew, or leave --view out");
}
ViewServer::~ViewServer() = default;

const ViewAddress& ViewServer::address() const { return work_->address; }
std::string ViewServer::url() const { return ""; }

}  // namespace swiftlet
