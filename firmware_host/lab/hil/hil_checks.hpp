#pragma once
// Whether a flight on a hardware-in-the-loop replay was what it must be: each fault told by the device's name
// with its remedy, health lowered while it lasts and good again after it, no wrong pose called good, no end
// missing. docs/hil.md gives the rules with their reasons.

#include <string>
#include <vector>

#include "firmware_host/lab/hil/hil_evidence.hpp"

namespace swiftlet {

struct HilCheck {
  std::string name;  ///< "told: imu unplug at 4.000 s"
  bool passed = false;
  std::string says;  ///< what was found, in a sentence
};

class HilVerdict {
 public:
  explicit HilVerdict(std::vector<HilCheck> checks) : checks_(std::move(checks)) {}

  [[nodiscard]] const std::vector<HilCheck>& checks() const { return checks_; }
  [[nodiscard]] bool passed() const;
  /// A line each.
  [[nodiscard]] std::string text() const;
  /// JUnit XML, a test case each; `suite` names the flight.
  [[nodiscard]] std::string junit(const std::string& suite) const;

 private:
  std::vector<HilCheck> checks_;
};

HilVerdict checkHil(const HilEvidence& evidence);

/// The longest part of a fault during which its device shows it, other faults of the device hiding the rest.
struct FaultStretch {
  Duration begin, end;  ///< after the first image
  [[nodiscard]] Duration length() const { return end - begin; }
};
FaultStretch longestVisible(const PlannedFault& fault, const FaultTimeline& faults);

}  // namespace swiftlet
