#pragma once
// Options for kept maps, shared by flight and replay.

#include <CLI/CLI.hpp>

#include "firmware_host/runs/kept_map_request.hpp"

namespace swiftlet {

/// `request` must outlive the parsing.
void addKeptMapOptions(CLI::App& command, KeptMapRequest& request);

}  // namespace swiftlet
