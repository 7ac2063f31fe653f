#pragma once
// events.log of a run folder: one line for each event and each remark, "seconds name text".

#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// The name of what is a remark of the executor, in words, and no event of the estimator.
inline constexpr std::string_view kRemarkName = "remark";

struct EventLine {
  Stamp stamp;
  std::string name;  ///< as eventName() has it, or "remark"
  std::string text;  ///< the rest of the line
};

/// In the file's order. InputError when the file cannot be read, and on a line without stamp or name: where
/// `skipped` is given such lines are left out and counted in it instead.
std::vector<EventLine> readEvents(const std::string& path, std::size_t* skipped = nullptr);

}  // namespace swiftlet
