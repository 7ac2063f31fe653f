#pragma once
// Exit code of a run that finished.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "firmware_host/commands/program.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {

/// Returns kExitFailed and prints the reason if the estimate was good for less than half of the run.
inline int verdictOf(const nlohmann::ordered_json& summary) {
  constexpr double kMost = 0.5;
  const double share = summary["verdict"]["share_good"].get<double>();
  if (share >= kMost) return kExitDone;
  warn(
      fmt::format("error: the health was good for only {:.0f} % of the run; see the lines under \"health\" "
                  "above and events.log\n",
                  100 * share));
  return kExitFailed;
}

}  // namespace swiftlet
