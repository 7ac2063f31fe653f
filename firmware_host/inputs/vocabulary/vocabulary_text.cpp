#include <array>
#include <cmath>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"

namespace swiftlet {
namespace {

constexpr const char* kTextRemedy = "Give a vocabulary in the format of DBoW2 or ORB-SLAM (ORBvoc.txt)";
constexpr std::int64_t kMaxBranching = 20, kMaxLevels = 10;  // limits of the original loaders

/// Blank-separated words of a text, line by line.
class Words {
 public:
  Words(const std::string& name, std::string_view text) : name_(name), rest_(text) {}

  /// Moves to the next line that is not blank.
  bool nextLine() {
    while (!rest_.empty()) {
      ++line_number_;
      const std::size_t end = rest_.find('\n');
      line_ = rest_.substr(0, end);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
      if (line_.find_first_not_of(" \t\r") != std::string_view::npos) return true;
    }
    return false;
  }
  /// The next word of the line; empty at the line's end.
  std::string_view next() {
    const std::size_t begin = line_.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return {};
    line_.remove_prefix(begin);
    const std::string_view word = line_.substr(0, line_.find_first_of(" \t\r"));
    line_.remove_prefix(word.size());
    return word;
  }
  std::int64_t integer(const char* field, std::int64_t low, std::int64_t high) {
    const std::string_view word = next();
    std::int64_t value = 0;
    if (word.empty()) throw error(field, "missing");
    if (!parseInteger(word, value) || value < low || value > high) {
      throw error(field, quoteInput(word) + " is not an integer from " + std::to_string(low) + " to " +
                             std::to_string(high));
    }
    return value;
  }
  double weight() {
    const std::string_view word = next();
    double value = 0;
    if (word.empty()) throw error("weight", "missing");
    if (!parseDouble(word, value) || !std::isfinite(value) || value < 0) {
      throw error("weight", quoteInput(word) + " is not a non-negative number");
    }
    return value;
  }
  [[nodiscard]] InputError error(const char* field, const std::string& message) const {
    return {name_, line_number_, field, message, kTextRemedy};
  }

 private:
  std::string name_;
  std::string_view rest_;
  std::string_view line_;
  int line_number_ = 0;
};

}  // namespace

std::vector<VocabularyNode> readVocabularyText(const std::string& name, std::string_view text) {
  Words words(name, text);
  if (!words.nextLine()) throw words.error("", "empty");
  (void)words.integer("branching", 2, kMaxBranching);
  (void)words.integer("levels", 1, kMaxLevels);
  constexpr std::int64_t kScorings = 6, kWeightings = 4;
  (void)words.integer("scoring", 0, kScorings - 1);
  (void)words.integer("weighting", 0, kWeightings - 1);
  std::vector<VocabularyNode> nodes;
  std::vector<bool> leaf;
  while (words.nextLine()) {
    VocabularyNode node;
    // A parent always precedes its children.
    node.parent =
        static_cast<std::uint32_t>(words.integer("parent", 0, static_cast<std::int64_t>(nodes.size())));
    if (node.parent > 0 && leaf[node.parent - 1]) throw words.error("parent", "is a leaf");
    leaf.push_back(words.integer("isLeaf", 0, 1) == 1);
    for (std::size_t i = 0; i < 32; ++i) {
      const auto byte = static_cast<std::uint64_t>(words.integer("descriptor", 0, 255));
      node.descriptor.words[i / 8] |= byte << (8 * (i % 8));
    }
    node.weight = static_cast<float>(words.weight());
    if (!words.next().empty()) throw words.error("weight", "its line has extra fields");
    nodes.push_back(node);
  }
  std::vector<bool> parent(nodes.size() + 1, false);
  for (const VocabularyNode& node : nodes) parent[node.parent] = true;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!leaf[i] && !parent[i + 1]) {
      throw InputError(name, 0, "isLeaf",
                       "node " + std::to_string(i + 1) + " is not a leaf and has no children", kTextRemedy);
    }
  }
  return nodes;
}

}  // namespace swiftlet
