#pragma once
// The rules of the house, each as a function from text to what breaks it, so that a test can show
// a rule both passing on the tree and failing on a planted example.

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/architecture/source_tree.hpp"

namespace swiftlet::architecture {

/// Room -> rooms it may include, closed over "knows what its neighbours know".
using RoomTable = std::map<std::string, std::set<std::string>>;

/// The house as docs/architecture.md draws it.
[[nodiscard]] const RoomTable& roomTable();

/// The room's own and the project's path rules: quoted includes start at the root and lead to a
/// room that this one may know.
[[nodiscard]] std::vector<Violation> checkIncludeDirections(const SourceFile& file);

/// No lock, exception, heap call, clock, file, stream or unordered container on the flight path.
[[nodiscard]] std::vector<Violation> checkFlightPath(const SourceFile& file);

/// No lock and no wait that another thread could prolong, by include or by name: the executor's flight path,
/// which may read clocks and own threads.
[[nodiscard]] std::vector<Violation> checkNoLocks(const SourceFile& file);

/// #pragma once in the first line, a comment in the second.
[[nodiscard]] std::vector<Violation> checkHeaderOpening(const SourceFile& file);

/// At most `limit` lines.
[[nodiscard]] std::vector<Violation> checkLength(const SourceFile& file, std::size_t limit);

/// No path that exists on one machine only, no note of work left undone, nothing that clang 14 does not
/// compile.
[[nodiscard]] std::vector<Violation> checkText(const SourceFile& file);

/// Libraries and tests name their sources one by one: a .cpp that its folder's CMakeLists.txt
/// (`list`) does not name is never built.
[[nodiscard]] std::vector<Violation> checkNamedInList(const SourceFile& file, const std::string& list);

}  // namespace swiftlet::architecture
