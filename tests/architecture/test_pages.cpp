// Links between the project's pages lead somewhere, and each figure is shown by a page.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <filesystem>
#include <iostream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/architecture/source_tree.hpp"

using namespace swiftlet::architecture;  // NOLINT(google-build-using-namespace)
namespace fs = std::filesystem;

namespace {

/// The name under which a heading can be linked to, as GitHub makes it.
std::string anchorOf(const std::string& heading) {
  const std::string text = std::regex_replace(heading, std::regex(R"(\[([^\]]*)\]\([^)]*\))"), "$1");
  std::string anchor;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '-' || c == '_' || byte >= 0x80) {
      anchor += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

struct Link {
  std::size_t line = 0;
  std::string target;
};

struct Page {
  std::set<std::string> anchors;
  std::vector<Link> links;
};

Page readPage(const std::vector<std::string>& lines) {
  static const std::regex kLink(R"(\]\(([^)\s]+)\))");
  Page page;
  bool fenced = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string& line = lines[i];
    if (line.starts_with("```")) fenced = !fenced;
    if (fenced) continue;
    if (line.starts_with("#")) {
      const std::string heading = line.substr(std::min(line.find_first_not_of('#') + 1, line.size()));
      const std::string anchor = anchorOf(heading);
      std::string name = anchor;
      for (int k = 1; page.anchors.contains(name); ++k) name = anchor + "-" + std::to_string(k);
      page.anchors.insert(name);
    }
    for (std::sregex_iterator it(line.begin(), line.end(), kLink); it != std::sregex_iterator(); ++it) {
      page.links.push_back({i + 1, (*it)[1]});
    }
  }
  return page;
}

/// `pages` by path below the root; other files are looked for on disk.
std::vector<Violation> checkLinks(const std::map<std::string, Page>& pages, std::set<std::string>& reached) {
  std::vector<Violation> found;
  for (const auto& [path, page] : pages) {
    for (const Link& link : page.links) {
      if (link.target.starts_with("http")) continue;
      const std::size_t hash = link.target.find('#');
      const std::string file = link.target.substr(0, hash);
      const std::string target =
          file.empty() ? path : (fs::path(path).parent_path() / file).lexically_normal().string();
      reached.insert(target);
      const auto other = pages.find(target);
      if (other == pages.end()) {
        if (!fs::exists(projectRoot() / target)) found.push_back({path, link.line, "no file " + target});
      } else if (hash != std::string::npos && !other->second.anchors.contains(link.target.substr(hash + 1))) {
        found.push_back({path, link.line, "no heading for " + link.target});
      }
    }
  }
  return found;
}

}  // namespace

TEST_CASE("links of pages lead to files and headings, and each figure is shown") {
  std::map<std::string, Page> pages;
  for (const SourceFile& file : readTextFiles()) {
    if (file.path.ends_with(".md")) pages[file.path] = readPage(file.lines);
  }
  REQUIRE(pages.size() > 50);
  std::set<std::string> reached;
  std::vector<Violation> found = checkLinks(pages, reached);
  for (const auto& entry : fs::directory_iterator(projectRoot() / "docs/figures")) {
    const std::string figure = "docs/figures/" + entry.path().filename().string();
    if (!reached.contains(figure)) found.push_back({figure, 1, "no page shows this figure"});
  }
  std::cerr << describe(found);
  CHECK(found.empty());
}

TEST_CASE("a link to nowhere is found") {
  std::map<std::string, Page> pages;
  pages["docs/a.md"] =
      readPage({"# A page", "## The `same`, twice", "## The same, twice", "```", "# [x](none.md)", "```",
                "[b](b.md#of-b) [self](#the-same-twice-1) [top](../README.md)"});
  pages["docs/b.md"] = readPage({"# Of [B](a.md)", "[gone](c.md), [other](a.md#a-pages)"});
  std::set<std::string> reached;
  const std::vector<Violation> found = checkLinks(pages, reached);
  REQUIRE(found.size() == 2);
  CHECK(found[0].what == "no file docs/c.md");
  CHECK(found[1].what == "no heading for a.md#a-pages");
  CHECK(reached.contains("README.md"));
}
