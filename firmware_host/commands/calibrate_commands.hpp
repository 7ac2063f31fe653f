#pragma once
// The parts of `swiftlet calibrate`, a file for each.

#include <CLI/CLI.hpp>

namespace swiftlet {

void addCalibrateTarget(CLI::App& calibrate, int& exit_code);
void addCalibrateCameras(CLI::App& calibrate, int& exit_code);
void addCalibrateImuCamera(CLI::App& calibrate, int& exit_code);
void addCalibrateImuNoise(CLI::App& calibrate, int& exit_code);
void addCalibrateCheck(CLI::App& calibrate, int& exit_code);

}  // namespace swiftlet
