#include "drivers/calibration/yaml_field.hpp"

#include <charconv>
#include <cmath>

namespace swiftlet {
namespace {

// Calibration files have a few kilobytes. A megabyte is something else, and the parser is recursive.
constexpr std::size_t kMaxYamlBytes = 1U << 20U;
constexpr int kMaxNesting = 64;

int lineOf(const YAML::Mark& mark) { return mark.is_null() ? 0 : mark.line + 1; }

/// Turns OpenCV's "%YAML:1.0", which YAML 1.2 does not allow, into a comment.
std::string withoutOpenCvHeader(std::string_view text) {
  std::string copy(text);
  if (copy.starts_with("\xEF\xBB\xBF")) copy.erase(0, 3);
  if (copy.starts_with("%YAML")) copy[0] = '#';
  return copy;
}

void refuseDeepNesting(const std::string& file, std::string_view text) {
  int depth = 0;
  int line = 1;
  for (const char c : text) {
    if (c == '\n') ++line;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') depth = std::max(0, depth - 1);
    if (depth > kMaxNesting) {
      throw InputError(file, line, "", "brackets are nested too deep", "This is not a calibration file");
    }
  }
}

}  // namespace

YamlField YamlField::parse(const std::string& file, std::string_view text) {
  if (text.size() > kMaxYamlBytes) {
    throw InputError(file, 0, "", "larger than 1 MiB", "This is not a calibration file");
  }
  if (text.starts_with("<?xml")) {
    throw InputError(file, 1, "", "is an XML file",
                     "Save it with OpenCV under a name that ends in .yml, which writes YAML");
  }
  refuseDeepNesting(file, text);
  try {
    YAML::Node root = YAML::Load(withoutOpenCvHeader(text));
    if (!root.IsMap()) {
      throw InputError(file, 1, "", "not a YAML map of `key: value` lines", "Give a file in YAML or JSON");
    }
    return {std::make_shared<const std::string>(file), "", root, 1};
  } catch (const YAML::Exception& error) {
    throw InputError(file, lineOf(error.mark), "", "not valid YAML (" + error.msg + ")",
                     "Compare the line with a file written by the calibration tool");
  }
}

bool YamlField::has(const std::string& key) const { return node_.IsMap() && node_[key].IsDefined(); }

YamlField YamlField::at(const std::string& key, const std::string& remedy) const {
  const std::string name = name_.empty() ? key : name_ + "." + key;
  if (!has(key)) throw InputError(*file_, line(), name, "missing", remedy);
  // A block value begins below its key; report the key's line, where users look.
  int key_line = line();
  for (const auto& pair : node_) {
    if (pair.first.IsScalar() && pair.first.Scalar() == key) key_line = lineOf(pair.first.Mark());
  }
  return {file_, name, node_[key], key_line};
}

std::vector<YamlField> YamlField::items() const {
  if (!node_.IsSequence()) throw error("expected a list", "Write it as [a, b, ...]");
  std::vector<YamlField> out;
  out.reserve(node_.size());
  for (std::size_t i = 0; i < node_.size(); ++i) {
    const int item_line = lineOf(node_[i].Mark());
    out.push_back(
        {file_, name_ + "[" + std::to_string(i) + "]", node_[i], item_line > 0 ? item_line : line()});
  }
  return out;
}

std::vector<std::string> YamlField::keys() const {
  std::vector<std::string> out;
  if (!isMap()) return out;
  for (const auto& pair : node_) {
    if (!pair.first.IsScalar()) throw error("a key is no single word", "Write lines of `key: value`");
    out.push_back(pair.first.Scalar());
  }
  return out;
}

std::string YamlField::text() const {
  if (!node_.IsScalar()) throw error("expected a single word", "Write it as `key: value`");
  return node_.Scalar();
}

double YamlField::number() const {
  const std::string scalar = text();
  const char* first = scalar.data();
  const char* last = first + scalar.size();
  if (first != last && *first == '+') ++first;
  double value = 0;
  const auto [end, code] = std::from_chars(first, last, value);
  if (code != std::errc{} || end != last || !std::isfinite(value)) {
    throw error("`" + scalar + "` is not a finite number", "Write a decimal number, for example 1.5e-3");
  }
  return value;
}

std::vector<double> YamlField::numbers() const {
  std::vector<double> out;
  for (const YamlField& item : items()) out.push_back(item.number());
  return out;
}

InputError YamlField::error(const std::string& message, const std::string& remedy) const {
  return {*file_, line(), name_, message, remedy};
}

}  // namespace swiftlet
