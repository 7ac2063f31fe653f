#include "tests/architecture/named_includes.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace swiftlet::architecture {
namespace {

/// What is used across the project and comes from one header, or from any of a few.
const std::map<std::string, std::vector<std::string>, std::less<>>& providers() {
  static const std::map<std::string, std::vector<std::string>, std::less<>> kProviders = {
      {"array", {"array"}},
      {"atomic", {"atomic"}},
      {"bit_cast", {"bit"}},
      {"chrono", {"chrono"}},
      {"clamp", {"algorithm"}},
      {"countr_zero", {"bit"}},
      {"exit", {"cstdlib"}},
      {"filesystem", {"filesystem"}},
      {"fprintf", {"cstdio"}},
      {"from_chars", {"charconv"}},
      {"function", {"functional"}},
      {"getenv", {"cstdlib"}},
      {"hypot", {"cmath"}},
      {"ifstream", {"fstream"}},
      {"int16_t", {"cstdint"}},
      {"int32_t", {"cstdint"}},
      {"int64_t", {"cstdint"}},
      {"iota", {"numeric"}},
      {"isfinite", {"cmath"}},
      {"istringstream", {"sstream"}},
      {"make_unique", {"memory"}},
      {"map", {"map"}},
      {"memcpy", {"cstring"}},
      {"mutex", {"mutex"}},
      {"nth_element", {"algorithm"}},
      {"numbers", {"numbers"}},
      {"numeric_limits", {"limits"}},
      {"ofstream", {"fstream"}},
      {"optional", {"optional"}},
      {"ostringstream", {"sstream"}},
      {"popcount", {"bit"}},
      {"ranges", {"algorithm", "ranges"}},
      {"runtime_error", {"stdexcept"}},
      {"set", {"set"}},
      {"shared_ptr", {"memory"}},
      {"snprintf", {"cstdio"}},
      {"sort", {"algorithm"}},
      {"span", {"span"}},
      {"sqrt", {"cmath"}},
      {"string", {"string"}},
      {"string_view", {"string_view", "string"}},
      {"thread", {"thread"}},
      {"tuple", {"tuple"}},
      {"uint16_t", {"cstdint"}},
      {"uint32_t", {"cstdint"}},
      {"uint64_t", {"cstdint"}},
      {"uint8_t", {"cstdint"}},
      {"unique_ptr", {"memory"}},
      {"variant", {"variant"}},
      {"vector", {"vector"}},
  };
  return kProviders;
}

/// The word after each `prefix`, in order.
std::vector<std::string_view> wordsAfter(std::string_view line, std::string_view prefix) {
  std::vector<std::string_view> words;
  for (std::size_t at = line.find(prefix); at != std::string_view::npos; at = line.find(prefix, at)) {
    const bool inside = at > 0 && (std::isalnum(static_cast<unsigned char>(line[at - 1])) != 0 ||
                                   line[at - 1] == '_' || line[at - 1] == ':');
    at += prefix.size();
    std::size_t end = at;
    while (end < line.size() &&
           (std::isalnum(static_cast<unsigned char>(line[end])) != 0 || line[end] == '_')) {
      ++end;
    }
    if (!inside) words.push_back(line.substr(at, end - at));
  }
  return words;
}

}  // namespace

IncludeGraph::IncludeGraph(const std::vector<SourceFile>& files) {
  for (const SourceFile& file : files) {
    Includes& includes = files_[file.path];
    for (const std::string& line : file.code_lines) {
      if (!line.starts_with("#include ")) continue;
      const char close = line[9] == '"' ? '"' : '>';
      const std::string name = line.substr(10, line.find(close, 10) - 10);
      (close == '"' ? includes.own : includes.system).push_back(name);
    }
  }
}

std::set<std::string> IncludeGraph::reached(const std::string& path) const {
  std::set<std::string> system;
  std::set<std::string> seen = {path};
  std::vector<std::string> open = {path};
  while (!open.empty()) {
    const auto file = files_.find(open.back());
    open.pop_back();
    if (file == files_.end()) continue;
    system.insert(file->second.system.begin(), file->second.system.end());
    for (const std::string& own : file->second.own) {
      if (seen.insert(own).second) open.push_back(own);
    }
  }
  return system;
}

std::vector<Violation> checkNamedIncludes(const SourceFile& file, const IncludeGraph& graph) {
  const std::set<std::string> reached = graph.reached(file.path);
  const bool eigen =
      std::ranges::any_of(reached, [](const auto& name) { return name.starts_with("Eigen/"); });
  std::vector<Violation> found;
  std::set<std::string_view> told;
  for (std::size_t i = 0; i < file.code_lines.size(); ++i) {
    if (!eigen && !wordsAfter(file.code_lines[i], "Eigen::").empty() && told.insert("Eigen").second) {
      found.push_back({file.path, i + 1, "names Eigen, and no include reaches it"});
    }
    for (const std::string_view word : wordsAfter(file.code_lines[i], "std::")) {
      const auto provider = providers().find(word);
      if (provider == providers().end()) continue;
      const auto is_reached = [&](const std::string& header) { return reached.contains(header); };
      if (std::ranges::any_of(provider->second, is_reached) || !told.insert(provider->first).second) continue;
      found.push_back(
          {file.path, i + 1,
           "names std::" + provider->first + " and does not include <" + provider->second.front() + ">"});
    }
  }
  return found;
}

}  // namespace swiftlet::architecture
