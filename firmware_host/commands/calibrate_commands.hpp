#pragma once
// The parts of `swiftlet calibrate`, each in its own file.

#include <CLI/CLI.hpp>
#include <string>

namespace swiftlet {

void addCalibrateTarget(CLI::App& calibrate, int& exit_code);
void addCalibrateCameras(CLI::App& calibrate, int& exit_code);
void addCalibrateImuCamera(CLI::App& calibrate, int& exit_code);
void addCalibrateImuNoise(CLI::App& calibrate, int& exit_code);
void addCalibrateCheck(CLI::App& calibrate, int& exit_code);

/// Name of the second output file: `out` with this extension. InputError if that is `out` itself.
std::string fileBeside(const std::string& out, const char* extension);

}  // namespace swiftlet
