#pragma once
// Settings from YAML files and `key=value` overrides, and back to YAML.
//
// Every complaint is an InputError that names file, line, key, the allowed range and the remedy.
// Unknown keys, keys given twice and values outside their bounds are errors, never ignored.

#include <string>
#include <string_view>

#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// Applies a YAML file on top of `settings` (unchanged when it throws).
void readSettingsFile(const std::string& path, Settings& settings);

/// The same from text; `name` names the file in messages.
void readSettingsText(const std::string& name, std::string_view text, Settings& settings);

/// Applies one `group.name=value`.
void overrideSetting(std::string_view assignment, Settings& settings);

/// The whole tree as YAML. With `explain`, a comment above each setting gives its explanation, unit, range
/// and default.
std::string printSettings(const Settings& settings, bool explain);

}  // namespace swiftlet
