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
  std::string name;
  std::string text;  ///< the rest of the line
};

/// In the file's order; lines without a stamp are left out and counted in `skipped`. InputError when the file
/// cannot be read.
std::vector<EventLine> readEvents(const std::string& path, std::size_t* skipped = nullptr);

}  // namespace swiftlet
