#include "tests/architecture/source_tree.hpp"
#include "tests/support/text.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <iterator>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>

namespace swiftlet::architecture {
namespace {

namespace fs = std::filesystem;

bool isIdentifier(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

/// Index one past the literal that opens at `begin` with a quote; escapes are honoured.
std::size_t endOfLiteral(const std::string& text, std::size_t begin) {
  const char quote = text[begin];
  std::size_t at = begin + 1;
  while (at < text.size() && text[at] != quote && text[at] != '\n') at += text[at] == '\\' ? 2 : 1;
  return std::min(at + 1, text.size());
}

/// Index one past the raw string whose opening quote is at `begin`.
std::size_t endOfRawString(const std::string& text, std::size_t begin) {
  const std::size_t open = text.find('(', begin);
  if (open == std::string::npos) return text.size();
  const std::string closing = ")" + text.substr(begin + 1, open - begin - 1) + "\"";
  const std::size_t close = text.find(closing, open);
  return close == std::string::npos ? text.size() : close + closing.size();
}

/// Index one past the comment or literal that starts at `at`; `at` itself when none does.
std::size_t endOfNonCode(const std::string& text, std::size_t at) {
  if (text.compare(at, 2, "//") == 0) return std::min(text.find('\n', at), text.size());
  if (text.compare(at, 2, "/*") == 0) {
    const std::size_t close = text.find("*/", at + 2);
    return close == std::string::npos ? text.size() : close + 2;
  }
  const char before = at > 0 ? text[at - 1] : ' ';
  if (text[at] == '"') return before == 'R' ? endOfRawString(text, at) : endOfLiteral(text, at);
  // Between digits the apostrophe separates groups: 1'000'000.
  if (text[at] == '\'' && !isIdentifier(before)) return endOfLiteral(text, at);
  return at;
}

bool isIncludeLine(const std::string& line) {
  const std::size_t hash = line.find_first_not_of(" \t");
  return hash != std::string::npos && line[hash] == '#' && line.find("include", hash) != std::string::npos;
}

std::vector<std::string> splitLines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string blankNonCode(const std::string& text) {
  std::string code = text;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = endOfNonCode(text, at);
    for (std::size_t i = at; i < end; ++i) {
      if (code[i] != '\n') code[i] = ' ';
    }
    at = std::max(end, at + 1);
  }
  return code;
}

bool isSource(const fs::path& file) { return file.extension() == ".hpp" || file.extension() == ".cpp"; }

/// Recorded data and fuzz inputs are not the project's text.
bool isText(const fs::path& file) {
  static constexpr std::array<std::string_view, 12> kEndings = {
      ".hpp", ".cpp", ".txt", ".md", ".cmake", ".in", ".sh", ".py", ".json", ".yaml", ".yml", ".html"};
  const std::string ending = file.extension().string();
  return ending.empty() || std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

bool isLeftOut(const std::string& path) {
  return path.starts_with("tests/data/") || path.starts_with("tests/fuzz/corpus");
}

SourceFile readFile(const fs::path& file) {
  return parseSource(fs::relative(file, projectRoot()).generic_string(), test::textOf(file));
}

template <typename Accept>
void collect(const fs::path& folder, const Accept& accept, std::vector<SourceFile>& files) {
  if (!fs::is_directory(folder)) return;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && accept(entry.path())) files.push_back(readFile(entry.path()));
  }
}

void sortByPath(std::vector<SourceFile>& files) {
  std::sort(files.begin(), files.end(),
            [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
}

/// Names of git's files in the root, where users leave what they made; empty: not a clone.
std::set<std::string> trackedAtRoot() {
  const std::string command = "git -C '" + projectRoot().string() + "' ls-files 2>/dev/null";
  std::set<std::string> names;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return names;
  std::array<char, 4096> line{};
  while (std::fgets(line.data(), static_cast<int>(line.size()), pipe) != nullptr) {
    std::string name(line.data());
    name.erase(name.find_last_not_of('\n') + 1);
    if (name.find('/') == std::string::npos) names.insert(name);
  }
  pclose(pipe);
  return names;
}

}  // namespace

bool SourceFile::isHeader() const { return path.ends_with(".hpp"); }

std::string SourceFile::room() const {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) return "";
  const std::string top = *folder.begin();
  // The tests and the mesher are one room each; of the program, inputs, outputs and lab are groups of rooms,
  // and in lab calibrate is one.
  std::size_t depth = top == "tests" || top == "mesher" ? 1 : 2;
  if (top == "firmware_host") {
    const std::string group = folder == top ? "" : std::next(folder.begin())->string();
    if (group == "inputs" || group == "outputs" || group == "lab") depth = 3;
    if (folder.generic_string().starts_with("firmware_host/lab/calibrate")) depth = 4;
  }
  std::filesystem::path room;
  for (const std::filesystem::path& part : folder) {
    if (depth-- == 0) break;
    room /= part;
  }
  return room.string();
}

std::string describe(const std::vector<Violation>& violations) {
  std::ostringstream text;
  for (const Violation& v : violations) {
    text << v.path;
    if (v.line > 0) text << ':' << v.line;
    text << ": " << v.what << '\n';
  }
  return text.str();
}

SourceFile parseSource(std::string path, const std::string& text) {
  SourceFile file{std::move(path), splitLines(text), splitLines(blankNonCode(text))};
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    // The file name of an #include is a literal to the reader above, and code to the rules; a
    // commented include is blank in the code already.
    if (isIncludeLine(file.code_lines[i])) file.code_lines[i] = file.lines[i];
  }
  return file;
}

fs::path projectRoot() {
  const fs::path root = SWIFTLET_SOURCE_ROOT;
  if (!fs::exists(root / "CMakeLists.txt")) throw std::runtime_error("no project at " + root.string());
  return root;
}

std::vector<SourceFile> readSources(const std::vector<std::string>& folders) {
  std::vector<SourceFile> files;
  for (const std::string& folder : folders) collect(projectRoot() / folder, isSource, files);
  sortByPath(files);
  return files;
}

std::vector<SourceFile> readTextFiles() {
  std::vector<SourceFile> files;
  const std::set<std::string> tracked = trackedAtRoot();
  for (const auto& entry : fs::directory_iterator(projectRoot())) {
    const std::string name = entry.path().filename().string();
    if (!tracked.empty() && !tracked.contains(name)) continue;
    if (entry.is_regular_file() && isText(entry.path())) files.push_back(readFile(entry.path()));
  }
  for (const char* folder :
       {".ci", "docs", "drivers", "estimator", "firmware_host", "mapping", "mesher", "tests", "toolchain"}) {
    collect(projectRoot() / folder, isText, files);
  }
  std::erase_if(files, [](const SourceFile& file) { return isLeftOut(file.path); });
  sortByPath(files);
  return files;
}

}  // namespace swiftlet::architecture
