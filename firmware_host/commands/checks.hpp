#pragma once
// Checks of option values with readable `--help` texts: CLI11's own print internal enumerators and 300-digit
// bounds.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace swiftlet {

/// `holds` accepts or rejects the number; `what` describes the accepted numbers in help and messages.
inline CLI::Validator numberCheck(const std::string& what, std::function<bool(double)> holds) {
  const auto check = [what, holds = std::move(holds)](std::string& text) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && holds(value);
    return good ? std::string() : "`" + text + "` is not a number " + what;
  };
  return CLI::Validator(check, what);
}

/// Most options are seconds: neither a stamp nor 30 years in nanoseconds overflows.
inline CLI::Validator nonNegative() {
  return numberCheck("from 0 to 1e9", [](double value) { return value >= 0 && value <= 1e9; });
}

inline CLI::Validator positive() {
  return numberCheck("above 0 to 1e9", [](double value) { return value > 0 && value <= 1e9; });
}

inline CLI::Validator range(double least, double most) {
  const auto text = [](double value) { return CLI::detail::to_string(value); };
  return numberCheck("from " + text(least) + " to " + text(most),
                     [least, most](double value) { return value >= least && value <= most; });
}

/// Adds an option with a fixed list of values, in upper or lower case. Help lists the values and the default,
/// which is the initial content of `value`.
template <typename Enum>
void addChoice(CLI::App& command, const std::string& option, Enum& value, const std::string& help,
               const std::vector<std::pair<std::string, Enum>>& choices) {
  std::string names;
  std::string chosen;
  for (const auto& [name, kind] : choices) {
    names += (names.empty() ? "" : "|") + name;
    if (kind == value) chosen = name;
  }
  const auto set = [choices, names, option, &value](const std::string& text) {
    std::string lower = text;
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    for (const auto& [name, kind] : choices) {
      if (name != lower) continue;
      value = kind;
      return;
    }
    throw CLI::ValidationError(option, "`" + text + "` is not one of " + names);
  };
  command.add_option_function<std::string>(option, set, help)->type_name(names)->default_str(chosen);
}

}  // namespace swiftlet
