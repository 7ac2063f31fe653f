#pragma once
// Every setting by name: key, unit, explanation, bounds, and its place in the settings tree.

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct IntegerSetting {
  std::function<int&(Settings&)> value;
  int low = 0;
  int high = 0;
};

struct RealSetting {
  std::function<double&(Settings&)> value;
  double low = 0;
  double high = 0;
};

/// A number, or a word in its place; the word leaves the number at its default.
struct RealOrWordSetting : RealSetting {
  std::string_view word;
  std::function<bool&(Settings&)> chosen;  ///< the word was given instead of a number
};

struct SwitchSetting {
  std::function<bool&(Settings&)> value;
};

/// Text such as a file name; may be empty.
struct TextSetting {
  std::function<std::string&(Settings&)> value;
  std::string_view what;  ///< what the text is, in words
};

/// One of a few words.
struct ChoiceSetting {
  std::function<std::string&(Settings&)> value;
  std::vector<std::string_view> words;
};

struct Setting {
  std::string_view key;   ///< "group.name", as in YAML and on the command line
  std::string_view unit;  ///< empty for pure numbers
  std::string_view doc;   ///< one or two sentences
  std::variant<IntegerSetting, RealSetting, RealOrWordSetting, SwitchSetting, TextSetting, ChoiceSetting>
      kind;
};

/// All settings, grouped.
std::span<const Setting> settingsRegistry();

/// The setting called `key`, or null.
const Setting* findSetting(std::string_view key);

/// The setting that `key` most likely means; empty if none is near.
std::string_view nearestSetting(std::string_view key);

/// The value as YAML text (the word if that is chosen): numbers in the shortest form that reads back to the
/// same value, text in quotes.
std::string valueText(const Setting& setting, const Settings& settings);

/// The allowed values in words: "0.5 to 30 s", "true or false".
std::string rangeText(const Setting& setting);

}  // namespace swiftlet
