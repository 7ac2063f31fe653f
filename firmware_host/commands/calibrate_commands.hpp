#pragma once
// The parts of `swiftlet calibrate`, a file for each.

#include <CLI/CLI.hpp>
#include <string>

namespace swiftlet {

void addCalibrateTarget(CLI::App& calibrate, int& exit_code);
void addCalibrateCameras(CLI::App& calibrate, int& exit_code);
void addCalibrateImuCamera(CLI::App& calibrate, int& exit_code);
void addCalibrateImuNoise(CLI::App& calibrate, int& exit_code);
void addCalibrateCheck(CLI::App& calibrate, int& exit_code);

/// The second file of `--out`: its name with this extension. InputError if that is `out` itself.
std::string fileBeside(const std::string& out, const char* extension);

}  // namespace swiftlet
