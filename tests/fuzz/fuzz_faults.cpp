#include "tests/fuzz/fuzz_faults.hpp"

#include <cmath>
#include <cstdlib>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/hil/fault_timeline.hpp"

namespace swiftlet::fuzz {

void faults(std::string_view text) {
  const auto demand = [](bool holds) {
    if (!holds) std::abort();
  };
  try {
    const FaultTimeline timeline = FaultTimeline::parse("faults.csv", text);
    Duration newest;
    for (const PlannedFault& fault : timeline.faults()) {
      demand(fault.begin >= newest && fault.length >= Duration{} && std::isfinite(fault.value));
      newest = fault.begin;
      const PlannedFault* active = timeline.active(fault.device, fault.kind, fault.begin);
      demand(fault.length == Duration{} || active != nullptr);
      static_cast<void>(timeline.strikes(fault, text.size()));
    }
    static_cast<void>(timeline.clockStep(newest));
    const std::string once = timeline.text();
    demand(FaultTimeline::parse("again", once).text() == once);
  } catch (const InputError&) {
  }
}

}  // namespace swiftlet::fuzz
