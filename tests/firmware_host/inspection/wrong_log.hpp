#pragma once
// Logs with one mistake each, made from a good one: its text files written anew, its images linked.

#include <filesystem>
#include <string>
#include <vector>

namespace swiftlet::test {

struct Mistake {
  std::string name;   ///< "gyro_degrees", ...
  std::string named;  ///< begin of the finding, or part of the error, that names it; empty: nothing to find
};

/// All that wrongLog() can make; the first is none at all.
const std::vector<Mistake>& mistakes();

/// Writes the EuRoC folder `log` with the mistake to `out`, which must not exist.
void wrongLog(const std::filesystem::path& log, const std::string& mistake, const std::filesystem::path& out);

}  // namespace swiftlet::test
