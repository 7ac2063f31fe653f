#pragma once
// Reads settings from YAML files and `key=value` overrides, and prints them as YAML.
//
// Every error is an InputError that names file, line, key, the allowed range and the remedy. Unknown keys,
// duplicate keys and values out of range are errors, never ignored.

#include <string>
#include <string_view>

#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Applies a YAML file to `settings`, which stay unchanged if it throws.
void readSettingsFile(const std::string& path, Settings& settings);

/// Applies YAML text like a file; `name`: the file's name in messages.
void readSettingsText(const std::string& name, std::string_view text, Settings& settings);

/// Applies one `group.name=value`.
void overrideSetting(std::string_view assignment, Settings& settings);

/// The whole tree as YAML. With `explain`, a comment above each setting gives its explanation, unit, range
/// and default.
std::string printSettings(const Settings& settings, bool explain);

}  // namespace swiftlet
