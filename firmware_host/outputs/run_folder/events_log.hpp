#pragma once
// events.log of a run folder: one line for each event and each remark, "seconds name text".

#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Name of lines that are remarks of the executor and not events of the estimator.
inline constexpr std::string_view kRemarkName = "remark";

struct EventLine {
  Stamp stamp;
  std::string name;  ///< from eventName(), or "remark"
  std::string text;  ///< the rest of the line
};

/// In the file's order. InputError if the file cannot be read, and for a line without stamp or name; if
/// `skipped` is given, such lines are omitted and counted there instead.
std::vector<EventLine> readEvents(const std::string& path, std::size_t* skipped = nullptr);

}  // namespace swiftlet
