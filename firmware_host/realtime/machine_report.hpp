#pragma once
// Facts about this machine that delay real-time threads, each with a verdict and a remedy, before anything is
// measured. Nothing is changed and nothing fails. What does not exist or cannot be read is "unknown".

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace swiftlet {

enum class MachineVerdict {
  kGood,
  kNote,     ///< harmless; useful if measurements are unexpected
  kPoor,     ///< costs latency; see the remedy
  kUnknown,  ///< not available
};
/// "good", "note", "poor", "unknown".
const char* verdictName(MachineVerdict verdict);

struct MachineLine {
  std::string what;   ///< "real-time throttling", "CPU governor", ...
  std::string found;  ///< as the machine states it, with units
  MachineVerdict verdict = MachineVerdict::kUnknown;
  std::string remedy;  ///< empty if there is nothing to do
};

struct MachineReport {
  std::vector<MachineLine> lines;

  /// The line called `what`, or null.
  [[nodiscard]] const MachineLine* find(const std::string& what) const;
  /// A table with remedies indented below their lines.
  [[nodiscard]] std::string text(const std::string& title = "this machine") const;
  /// [{"what", "found", "verdict", "remedy"}]
  [[nodiscard]] nlohmann::ordered_json json() const;
};

/// Lines: "real-time throttling", "real-time priority", "locked memory", "preemption", "CPUs", "CPU
/// governor", "idle states", "interrupts", "CPU quota", "real-time quota" (version 1 control groups),
/// "clock". `root` is the prefix of every path that is read ("" for this computer, a folder with the same
/// files in tests). `priority` is the highest priority of the flight threads.
MachineReport inspectMachine(const std::string& root = "", int priority = 45);

}  // namespace swiftlet
