#pragma once
// What the program can do away from the vehicle; a build without SWIFTLET_BUILD_LAB has none of it.

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
/// Guidance of a recording in front of the board that the file describes; `view`: where it is shown beside
/// the console. InputError without the lab.
std::unique_ptr<RecordWatcher> labGuidance(const std::string& board, const std::optional<ViewAddress>& view);

}  // namespace swiftlet
