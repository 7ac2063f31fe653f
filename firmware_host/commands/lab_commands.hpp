#pragma once
// Commands and functions of the lab; a build without SWIFTLET_BUILD_LAB has none of them.

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"
#include "firmware_host/runs/record_watcher.hpp"
#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {

void addLabCommands(CLI::App& app, int& exit_code);
/// Empty without the lab.
AccuracyOfRun labAccuracy();
/// Guidance for a recording in front of the board described by the file. `view`: where it is shown in
/// addition to the console. InputError without the lab.
std::unique_ptr<RecordWatcher> labGuidance(const std::string& board, const std::optional<ViewAddress>& view);

}  // namespace swiftlet
