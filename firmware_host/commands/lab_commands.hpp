#pragma once
// What the program can do away from the vehicle; a build without SWIFTLET_BUILD_LAB has none of it.

#include <CLI/CLI.hpp>

#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {

void addLabCommands(CLI::App& app, int& exit_code);
/// Empty without the lab.
AccuracyOfRun labAccuracy();

}  // namespace swiftlet
