#include <algorithm>
#include <cmath>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"

namespace swiftlet {
namespace {

// OpenCV's FileStorage writes "key:value" without a blank, which general YAML parsers do not recognize as a
// key, and a large vocabulary would need a million of their nodes. So this file's own parser reads only the
// form that these files have.
constexpr const char* kYamlRemedy = "Give a vocabulary saved by DBoW2";
constexpr std::string_view kBlank = " \t\r\n";
constexpr std::int64_t kMaxNodes = 16'000'000;

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// An item "{ key:value, ... }" and the line on which it begins.
struct Item {
  const std::string& name;
  std::string_view text;
  int line;

  [[nodiscard]] InputError error(const char* field, const std::string& message) const {
    return {name, line, field, message, kYamlRemedy};
  }
  /// The value of a key, without quotes.
  [[nodiscard]] std::optional<std::string_view> find(std::string_view key) const {
    std::string_view rest = text;
    while (!rest.empty()) {
      const std::size_t colon = rest.find(':');
      if (colon == std::string_view::npos) return std::nullopt;
      const std::string_view found = trimmed(rest.substr(0, colon));
      rest = rest.substr(colon + 1);
      rest.remove_prefix(std::min(rest.find_first_not_of(kBlank), rest.size()));
      std::string_view value;
      if (rest.starts_with('"')) {
        const std::size_t end = rest.find('"', 1);
        if (end == std::string_view::npos) return std::nullopt;
        value = rest.substr(1, end - 1);
        rest.remove_prefix(end + 1);
      } else {
        value = trimmed(rest.substr(0, rest.find(',')));
      }
      if (found == key) return value;
      const std::size_t comma = rest.find(',');
      if (comma == std::string_view::npos) return std::nullopt;
      rest.remove_prefix(comma + 1);
    }
    return std::nullopt;
  }
  [[nodiscard]] std::string_view value(const char* key) const {
    const auto found = find(key);
    if (!found) throw error(key, "missing");
    return *found;
  }
  [[nodiscard]] std::size_t id(const char* key, std::int64_t low) const {
    std::int64_t number = 0;
    if (!parseInteger(value(key), number) || number < low || number > kMaxNodes) {
      throw error(key, quoteInput(value(key)) + " is not a node number");
    }
    return static_cast<std::size_t>(number);
  }
  [[nodiscard]] float weight() const {
    double number = 0;
    if (!parseDouble(value("weight"), number) || !std::isfinite(number) || number < 0) {
      throw error("weight", quoteInput(value("weight")) + " is not a non-negative number");
    }
    return static_cast<float>(number);
  }
  [[nodiscard]] Descriptor descriptor() const {
    std::string_view rest = value("descriptor");
    Descriptor out;
    for (std::size_t i = 0; i < 32; ++i) {
      rest.remove_prefix(std::min(rest.find_first_not_of(kBlank), rest.size()));
      const std::string_view word = rest.substr(0, rest.find_first_of(kBlank));
      std::int64_t byte = 0;
      if (!parseInteger(word, byte) || byte < 0 || byte > 255)
        throw error("descriptor", "needs 32 bytes from 0 to 255");
      rest.remove_prefix(word.size());
      out.words[i / 8] |= static_cast<std::uint64_t>(byte) << (8 * (i % 8));
    }
    if (!trimmed(rest).empty()) throw error("descriptor", "has more than 32 bytes");
    return out;
  }
};

/// Calls `use` with every item in braces.
template <typename Use>
void forEachItem(const std::string& name, std::string_view text, const Use& use) {
  int line = 1;
  for (std::size_t at = 0;;) {
    const std::size_t open = text.find('{', at);
    if (open == std::string_view::npos) return;
    line += static_cast<int>(std::count(text.begin() + static_cast<std::ptrdiff_t>(at),
                                        text.begin() + static_cast<std::ptrdiff_t>(open), '\n'));
    const std::size_t close = text.find('}', open);
    if (close == std::string_view::npos)
      throw InputError(name, line, "", "a brace is not closed", kYamlRemedy);
    const std::string_view inside = text.substr(open + 1, close - open - 1);
    use(Item{name, inside, line});
    line += static_cast<int>(std::count(inside.begin(), inside.end(), '\n'));
    at = close + 1;
  }
}

}  // namespace

std::vector<VocabularyNode> readVocabularyYaml(const std::string& name, std::string_view text) {
  std::vector<std::pair<std::size_t, VocabularyNode>> listed;
  std::vector<std::size_t> leaves;
  forEachItem(name, text, [&](const Item& item) {
    if (item.find("wordId")) {
      leaves.push_back(item.id("nodeId", 1));
      return;
    }
    VocabularyNode node;
    node.parent = static_cast<std::uint32_t>(item.id("parentId", 0));
    node.weight = item.weight();
    node.descriptor = item.descriptor();
    listed.push_back({item.id("nodeId", 1), node});
  });
  std::stable_sort(listed.begin(), listed.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<VocabularyNode> nodes;
  std::vector<bool> parent(listed.size() + 1, false);
  for (const auto& [id, node] : listed) {
    if (id != nodes.size() + 1) {
      throw InputError(name, 0, "nodeId", "nodes are not numbered 1, 2, ... without gaps", kYamlRemedy);
    }
    if (node.parent > listed.size()) {
      throw InputError(name, 0, "parentId", "node " + std::to_string(id) + "'s parent does not exist",
                       kYamlRemedy);
    }
    parent[node.parent] = true;
    nodes.push_back(node);
  }
  for (const std::size_t leaf : leaves) {
    if (leaf > nodes.size() || parent[leaf]) {
      throw InputError(name, 0, "words", "node " + std::to_string(leaf) + " is not a leaf", kYamlRemedy);
    }
  }
  return nodes;
}

}  // namespace swiftlet
