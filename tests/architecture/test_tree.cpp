// The rules of the house, applied to the tree as it stands.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <map>
#include <regex>

#include "tests/architecture/named_includes.hpp"
#include "tests/architecture/rules.hpp"
#include "tests/support/text.hpp"

using namespace swiftlet::architecture;  // NOLINT(google-build-using-namespace)

namespace {

using swiftlet::test::textOf;

constexpr std::size_t kMaxFileLines = 600;
constexpr std::size_t kMaxReadmeLines = 100;

const std::vector<std::string>& rooms() {
  static const std::vector<std::string> kRooms = {"estimator", "mesher", "mapping", "drivers",
                                                  "firmware_host"};
  return kRooms;
}

std::vector<std::string> roomsAndTests() {
  std::vector<std::string> folders = rooms();
  folders.emplace_back("tests");
  return folders;
}

void append(std::vector<Violation>& all, const std::vector<Violation>& some) {
  all.insert(all.end(), some.begin(), some.end());
}

void requireNone(const std::vector<Violation>& violations) {
  // Past Catch2's line wrapping: one violation a row, as editors read it.
  std::cerr << describe(violations);
  CHECK(violations.empty());
}

/// The CMakeLists.txt of the file's folder and of the folders above it, joined.
std::string listsAbove(const SourceFile& file) {
  std::string lists;
  for (std::filesystem::path folder = std::filesystem::path(file.path).parent_path(); !folder.empty();
       folder = folder.parent_path()) {
    lists += textOf(projectRoot() / folder / "CMakeLists.txt");
  }
  return lists;
}

}  // namespace

TEST_CASE("includes point the way the house is drawn") {
  std::vector<Violation> found;
  const auto files = readSources(rooms());
  REQUIRE(files.size() > 10);
  for (const SourceFile& file : files) append(found, checkIncludeDirections(file));
  requireNone(found);
}

TEST_CASE("the flight path has no locks, exceptions, heap calls or clocks") {
  std::vector<Violation> found;
  const auto files = readSources({"estimator", "mesher"});
  REQUIRE(files.size() > 10);
  for (const SourceFile& file : files) append(found, checkFlightPath(file));
  requireNone(found);
}

TEST_CASE("the program's flight path has no locks") {
  // The executor, the threads of devices with their drivers, and followers at a real-time priority.
  static const std::vector<std::string> kFolders = {"firmware_host/interfaces",
                                                    "firmware_host/graph",
                                                    "firmware_host/schedule",
                                                    "firmware_host/supervisor",
                                                    "firmware_host/realtime",
                                                    "firmware_host/inputs",
                                                    "firmware_host/outputs/autopilot",
                                                    "drivers/device",
                                                    "drivers/image",
                                                    "drivers/v4l2",
                                                    "drivers/serial",
                                                    "drivers/can",
                                                    "drivers/gpio",
                                                    "drivers/mavlink",
                                                    "drivers/timesync"};
  std::vector<Violation> found;
  std::vector<std::string> folders;
  std::ranges::copy_if(kFolders, std::back_inserter(folders), [](const std::string& folder) {
    return std::filesystem::exists(projectRoot() / folder);
  });
  const auto files = readSources(folders);
  REQUIRE(folders.size() > 8);
  REQUIRE(files.size() > 100);
  for (const SourceFile& file : files) append(found, checkNoLocks(file));
  requireNone(found);
}

TEST_CASE("headers open with #pragma once and say what they are") {
  std::vector<Violation> found;
  for (const SourceFile& file : readSources(roomsAndTests())) {
    if (file.isHeader()) append(found, checkHeaderOpening(file));
  }
  requireNone(found);
}

// Two classes of one name share inline members: the linker keeps those of either.
TEST_CASE("no two headers define the same type") {
  static const std::regex kNamespace(R"(^namespace ([a-z_0-9:]+) \{)");
  static const std::regex kType(R"(^(?:class|struct|enum class|union) ([A-Z]\w*)\b(?!::)[^;]*$)");
  std::map<std::string, std::string> defined;
  std::vector<Violation> found;
  for (const SourceFile& file : readSources(rooms())) {
    if (!file.isHeader()) continue;
    std::string space;
    for (std::size_t i = 0; i < file.code_lines.size(); ++i) {
      std::smatch match;
      if (std::regex_search(file.code_lines[i], match, kNamespace)) space = match[1];
      if (!std::regex_search(file.code_lines[i], match, kType)) continue;
      const std::string name = space + "::" + match[1].str();
      const std::string& first = defined.try_emplace(name, file.path).first->second;
      if (first != file.path) found.push_back({file.path, i + 1, name + " is also defined in " + first});
    }
  }
  REQUIRE(defined.size() > 100);
  requireNone(found);
}

TEST_CASE("files include what they name") {
  std::vector<Violation> found;
  const auto files = readSources(roomsAndTests());
  const IncludeGraph graph(files);
  for (const SourceFile& file : files) append(found, checkNamedIncludes(file, graph));
  requireNone(found);
}

TEST_CASE("files stay readable in length") {
  std::vector<Violation> found;
  for (const SourceFile& file : readSources(roomsAndTests())) append(found, checkLength(file, kMaxFileLines));
  const SourceFile readme = parseSource("README.md", textOf(projectRoot() / "README.md"));
  REQUIRE(!readme.lines.empty());
  append(found, checkLength(readme, kMaxReadmeLines));
  requireNone(found);
}

TEST_CASE("no text names one machine's paths or leaves work undone") {
  std::vector<Violation> found;
  const auto files = readTextFiles();
  REQUIRE(files.size() > 20);
  for (const SourceFile& file : files) append(found, checkText(file));
  requireNone(found);
}

TEST_CASE("every source is named in a CMakeLists.txt") {
  std::vector<Violation> found;
  for (const SourceFile& file : readSources(roomsAndTests())) {
    if (!file.isHeader()) append(found, checkNamedInList(file, listsAbove(file)));
  }
  requireNone(found);
}
