#pragma once
// The options of kept maps, the same for a flight and a replay.

#include <CLI/CLI.hpp>

#include "firmware_host/runs/kept_map_request.hpp"

namespace swiftlet {

/// `request` outlives the parsing.
void addKeptMapOptions(CLI::App& command, KeptMapRequest& request);

}  // namespace swiftlet
