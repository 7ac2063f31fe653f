#pragma once
// That a file includes what it names of the standard library and Eigen, itself or through the project's own
// headers. Builds parse those headers once for all units, so the compiler no longer tells.

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/architecture/source_tree.hpp"

namespace swiftlet::architecture {

class IncludeGraph {
 public:
  explicit IncludeGraph(const std::vector<SourceFile>& files);

  /// Headers in angle brackets that the file's include lines reach, through the project's headers alone.
  [[nodiscard]] std::set<std::string> reached(const std::string& path) const;

 private:
  struct Includes {
    std::vector<std::string> own;     ///< in quotes
    std::vector<std::string> system;  ///< in angle brackets
  };
  std::map<std::string, Includes> files_;
};

/// Names of the standard library whose header, and uses of Eigen of which no header, is reached.
[[nodiscard]] std::vector<Violation> checkNamedIncludes(const SourceFile& file, const IncludeGraph& graph);

}  // namespace swiftlet::architecture
