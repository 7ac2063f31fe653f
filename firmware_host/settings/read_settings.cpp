#include "firmware_host/settings/read_settings.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "firmware_host/settings/registry.hpp"

namespace swiftlet {
namespace {

constexpr const char* kListThem = "`swiftlet settings` prints all keys and their ranges";

/// Origin of a value.
struct Place {
  std::string file;
  int line = 0;
};

[[noreturn]] void failAt(const Place& place, std::string_view key, const std::string& message,
                         const std::string& remedy) {
  throw InputError(place.file, place.line, std::string(key), message, remedy);
}

const Setting& settingAt(const Place& place, std::string_view key) {
  if (const Setting* setting = findSetting(key)) return *setting;
  const std::string_view nearest = nearestSetting(key);
  failAt(place, key, "unknown setting",
         nearest.empty() ? std::string(kListThem) : fmt::format("Did you mean `{}`? {}", nearest, kListThem));
}

template <typename Value>
Value parsed(const Place& place, const Setting& setting, const YAML::Node& node) {
  Value value{};
  if (!node.IsScalar() || !YAML::convert<Value>::decode(node, value)) {
    const std::string found =
        node.IsScalar() ? fmt::format("`{}`", node.Scalar()) : "a list, a map or an empty value";
    failAt(place, setting.key, fmt::format("{} is not a valid value for this setting", found),
           "Allowed: " + rangeText(setting));
  }
  return value;
}

void assign(const Place& place, const Setting& setting, const YAML::Node& node, Settings& settings) {
  if (const auto* toggle = std::get_if<SwitchSetting>(&setting.kind)) {
    toggle->value(settings) = parsed<bool>(place, setting, node);
    return;
  }
  if (const auto* text = std::get_if<TextSetting>(&setting.kind)) {
    text->value(settings) = parsed<std::string>(place, setting, node);
    return;
  }
  if (const auto* choice = std::get_if<ChoiceSetting>(&setting.kind)) {
    const auto word = parsed<std::string>(place, setting, node);
    if (std::ranges::find(choice->words, word) == choice->words.end()) {
      failAt(place, setting.key, fmt::format("`{}` is not a valid value for this setting", word),
             "Allowed: " + rangeText(setting));
    }
    choice->value(settings) = word;
    return;
  }
  const auto bounded = [&](const auto& kind, auto value) {
    // NaN fails both comparisons and is refused.
    if (!(value >= kind.low && value <= kind.high)) {
      failAt(place, setting.key, fmt::format("{} is outside the allowed range", value),
             "Allowed: " + rangeText(setting));
    }
    kind.value(settings) = value;
  };
  if (const auto* whole = std::get_if<IntegerSetting>(&setting.kind)) {
    bounded(*whole, parsed<int>(place, setting, node));
  } else if (const auto* number = std::get_if<RealSetting>(&setting.kind)) {
    bounded(*number, parsed<double>(place, setting, node));
  } else {
    const auto& either = std::get<RealOrWordSetting>(setting.kind);
    const bool word = node.IsScalar() && node.Scalar() == either.word;
    if (word) {
      Settings defaults;
      either.value(settings) = either.value(defaults);
    } else {
      bounded(either, parsed<double>(place, setting, node));
    }
    either.chosen(settings) = word;
  }
}

void readGroup(const std::string& file, const YAML::Node& node, const std::string& prefix,
               Settings& settings) {
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const Place place{file, entry.first.Mark().line + 1};
    const std::string key = prefix + entry.first.Scalar();
    if (!seen.insert(key).second) failAt(place, key, "appears twice", "Remove one of the two lines");
    if (entry.second.IsMap()) {
      readGroup(file, entry.second, key + ".", settings);
    } else if (entry.second.IsNull() && findSetting(key) == nullptr) {
      continue;  // a group whose lines are all commented out
    } else {
      assign(place, settingAt(place, key), entry.second, settings);
    }
  }
}

std::string groupOf(std::string_view key) { return std::string(key.substr(0, key.find('.'))); }

}  // namespace

void readSettingsText(const std::string& name, std::string_view text, Settings& settings) {
  YAML::Node root;
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(std::string(text));
    for (std::size_t i = 1; i < documents.size(); ++i) {
      if (documents[i].IsNull()) continue;
      throw InputError(name, documents[i].Mark().line + 1, "",
                       "a second YAML document begins before this line",
                       "Remove the line `---` between the settings");
    }
    if (!documents.empty()) root = documents.front();
  } catch (const YAML::Exception& error) {
    throw InputError(name, error.mark.line + 1, "", "not valid YAML (" + error.msg + ")",
                     "Compare it with the output of `swiftlet settings`");
  }
  if (root.IsNull()) return;
  if (!root.IsMap()) {
    throw InputError(name, 1, "", "the file does not consist of `group:` and `name: value` lines",
                     "Compare it with the output of `swiftlet settings`");
  }
  Settings changed = settings;
  readGroup(name, root, "", changed);
  settings = changed;
}

void readSettingsFile(const std::string& path, Settings& settings) {
  readSettingsText(path, readFile(path, "Write a settings file with `swiftlet settings > settings.yaml`"),
                   settings);
}

void overrideSetting(std::string_view assignment, Settings& settings) {
  const std::size_t equals = assignment.find('=');
  const Place place{fmt::format("--set {}", assignment), 0};
  if (equals == std::string_view::npos) {
    failAt(place, "", "`=` is missing", "Write --set group.name=value");
  }
  const std::string_view key = assignment.substr(0, equals);
  const YAML::Node value(std::string(assignment.substr(equals + 1)));
  Settings changed = settings;
  assign(place, settingAt(place, key), value, changed);
  settings = changed;
}

std::string printSettings(const Settings& settings, bool explain) {
  const Settings defaults;
  std::string text;
  std::string group;
  for (const Setting& setting : settingsRegistry()) {
    if (groupOf(setting.key) != group) {
      group = groupOf(setting.key);
      text += fmt::format("{}{}:\n", text.empty() ? "" : "\n", group);
    }
    if (explain) {
      text += fmt::format("  # {}\n  # Range: {}; default {}.\n", setting.doc, rangeText(setting),
                          valueText(setting, defaults));
    }
    text += fmt::format("  {}: {}\n", setting.key.substr(group.size() + 1), valueText(setting, settings));
  }
  return text;
}

}  // namespace swiftlet
