#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/command.hpp"
#include "firmware_host/settings/read_settings.hpp"

namespace swiftlet {

void SettingsOptions::addTo(CLI::App& command) {
  command.add_option("--settings", file, "YAML file of settings (see `swiftlet settings`)");
  command.add_option("--set", overrides, "One setting as group.name=value; may be repeated")
      ->allow_extra_args(false);
}

Settings SettingsOptions::read() const {
  Settings settings;
  if (!file.empty()) readSettingsFile(file, settings);
  for (const std::string& assignment : overrides) overrideSetting(assignment, settings);
  return settings;
}

void addSettingsCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("settings", "Print all settings as YAML with explanations");
  auto options = std::make_shared<SettingsOptions>();
  auto brief = std::make_shared<bool>(false);
  options->addTo(*command);
  command->add_flag("--brief", *brief, "Print values without explanations");
  command->footer(
      "Example:\n  swiftlet settings > settings.yaml\n"
      "  swiftlet replay LOG --settings settings.yaml --set smoother.horizon=3");
  command->callback([options, brief, &exit_code] {
    fmt::print("{}", printSettings(options->read(), !*brief));
    exit_code = kExitDone;
  });
}

}  // namespace swiftlet
