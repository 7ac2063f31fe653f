#include "mapping/pose_graph/g2o_fields.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace swiftlet {
namespace {

constexpr std::string_view kBlank = " \t\r\v\f";
constexpr std::size_t kShownLength = 40;

/// Reads the whole word as a number; accepts a leading +, as C's readers do.
template <typename Number>
bool parse(std::string_view word, Number& out) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
  return error == std::errc() && end == word.data() + word.size();
}

}  // namespace

std::string shown(std::string_view word) {
  std::string text;
  for (const char c : word.substr(0, kShownLength)) text += c >= ' ' && c <= '~' ? c : '?';
  if (word.size() > kShownLength) text += "...";
  return text;
}

void G2oFields::start(std::string_view line, std::size_t number) {
  rest_ = line.substr(0, line.find('#'));
  rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlank), rest_.size()));
  kind_.clear();
  line_ = number;
  words_ = 0;
}

bool G2oFields::word(std::string_view& out) {
  if (rest_.empty()) return false;
  out = rest_.substr(0, rest_.find_first_of(kBlank));
  rest_.remove_prefix(out.size());
  rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlank), rest_.size()));
  if (words_++ == 0) kind_ = shown(out);
  return true;
}

bool G2oFields::missing(const char* name, G2oMessage& fault) const {
  fault = {line_, name, "missing: the line ends after " + std::to_string(words_) + " words",
           "Give all fields of " + kind_};
  return false;
}

bool G2oFields::id(const char* name, std::int64_t& out, G2oMessage& fault) {
  std::string_view text;
  if (!word(text)) return missing(name, fault);
  if (parse(text, out)) return true;
  fault = {line_, name, "`" + shown(text) + "` is not a vertex number", "Give a whole number"};
  return false;
}

bool G2oFields::number(const char* name, double& out, G2oMessage& fault) {
  std::string_view text;
  if (!word(text)) return missing(name, fault);
  if (parse(text, out) && std::isfinite(out)) return true;
  fault = {line_, name, "`" + shown(text) + "` is not a finite number", "Give a number such as -1.5e-3"};
  return false;
}

bool G2oFields::numbers(std::span<const char* const> names, std::span<double> out, G2oMessage& fault) {
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (!number(names[k], out[k], fault)) return false;
  }
  return true;
}

bool G2oFields::end(G2oMessage& fault) {
  if (rest_.empty()) return true;
  std::string_view text;
  const std::size_t taken = words_;
  word(text);
  fault = {line_, "word " + std::to_string(taken + 1), "`" + shown(text) + "` is more than " + kind_ + " has",
           "Remove it; a comment starts with #"};
  return false;
}

}  // namespace swiftlet
