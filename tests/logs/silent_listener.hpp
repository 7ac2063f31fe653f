#pragma once
// A listener for runs of which only the nodes, or the counters, are looked at.

#include <string>

#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet::test {

class SilentListener : public RunListener {
 public:
  void onFrame(const TrackedFrame& /*tracked*/, const OdometryOutput& /*output*/) override {}
  void onImuState(const NavState& /*state*/) override {}
  void onFinish(const OdometryOutput& /*output*/) override {}
  void onRemark(Stamp /*stamp*/, const std::string& /*text*/) override {}
};

}  // namespace swiftlet::test
