#pragma once
// The project's own files as the architecture tests read them: names, lines, and code without
// comments and literals. Text in, text out; nothing is compiled.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace swiftlet::architecture {

/// One file of the tree. `path` is relative to the project's root, with forward slashes.
struct SourceFile {
  std::string path;
  std::vector<std::string> lines;       ///< as written
  std::vector<std::string> code_lines;  ///< comments and literals blanked, same numbering

  [[nodiscard]] bool isHeader() const;
  /// The folder, as the room table names it: "estimator/core", "mesher", "firmware_host/lab/hil".
  [[nodiscard]] std::string room() const;
};

/// One broken rule. `line` counts from 1; 0 means the file as a whole.
struct Violation {
  std::string path;
  std::size_t line = 0;
  std::string what;
};

/// "path:line: what", one a row.
[[nodiscard]] std::string describe(const std::vector<Violation>& violations);

/// Splits text and blanks comments and literals. The text of #include lines is kept in both.
[[nodiscard]] SourceFile parseSource(std::string path, const std::string& text);

/// Where the project lies; throws std::runtime_error when it cannot be read.
[[nodiscard]] std::filesystem::path projectRoot();

/// Every .hpp and .cpp below the named folders, sorted by path.
[[nodiscard]] std::vector<SourceFile> readSources(const std::vector<std::string>& folders);

/// Every text file that belongs to the project (sources, scripts, documents), sorted by path;
/// recorded data is left out.
[[nodiscard]] std::vector<SourceFile> readTextFiles();

}  // namespace swiftlet::architecture
