#pragma once
// Checks a flight on a hardware-in-the-loop replay: each fault is reported with the device's name and its
// remedy, health is lowered while it lasts and good again afterwards, no wrong pose has good health, every
// fault's end is reported. docs/hil.md gives the rules with their reasons.

#include <string>
#include <vector>

#include "firmware_host/lab/hil/hil_evidence.hpp"

namespace swiftlet {

struct HilCheck {
  std::string name;  ///< the quantity and its limit
  bool passed = false;
  std::string says;  ///< the finding, in one sentence
};

class HilVerdict {
 public:
  explicit HilVerdict(std::vector<HilCheck> checks) : checks_(std::move(checks)) {}

  [[nodiscard]] const std::vector<HilCheck>& checks() const { return checks_; }
  [[nodiscard]] bool passed() const;
  /// One line per check.
  [[nodiscard]] std::string text() const;
  /// JUnit XML with one test case per check; `suite`: name of the flight.
  [[nodiscard]] std::string junit(const std::string& suite) const;

 private:
  std::vector<HilCheck> checks_;
};

HilVerdict checkHil(const HilEvidence& evidence);

/// The longest part of a fault during which the device shows it; other faults of the device hide the rest.
struct FaultStretch {
  Duration begin, end;  ///< after the first image
  [[nodiscard]] Duration length() const { return end - begin; }
};
FaultStretch longestVisible(const PlannedFault& fault, const FaultTimeline& faults);

}  // namespace swiftlet
