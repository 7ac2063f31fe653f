#pragma once
// The program's subcommands. Each function adds one to the parser, which runs it and stores its exit code.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "firmware_host/commands/program.hpp"  // exit codes
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

/// The options that every command has.
struct SettingsOptions {
  std::string file;
  std::vector<std::string> overrides;

  void addTo(CLI::App& command);
  /// Reads defaults, then the file, then the overrides. InputError.
  [[nodiscard]] Settings read() const;
};

void addBudgetCommand(CLI::App& app, int& exit_code);
void addCalibrateCommand(CLI::App& app, int& exit_code);
void addCalibrationCommand(CLI::App& app, int& exit_code);
void addCampaignCommand(CLI::App& app, int& exit_code);
void addReplayCommand(CLI::App& app, int& exit_code);
void addFlyCommand(CLI::App& app, int& exit_code);
void addRecordCommand(CLI::App& app, int& exit_code);
void addDoctorCommand(CLI::App& app, int& exit_code);
void addHilCommand(CLI::App& app, int& exit_code);
void addImportCommand(CLI::App& app, int& exit_code);
void addMeshCommand(CLI::App& app, int& exit_code);
void addFuseCommand(CLI::App& app, int& exit_code);
void addMapCommand(CLI::App& app, int& exit_code);
void addPlaceCommand(CLI::App& app, int& exit_code);
void addPoseGraphCommand(CLI::App& app, int& exit_code);
void addExportCommand(CLI::App& app, int& exit_code);
void addEvaluateCommand(CLI::App& app, int& exit_code);
void addReportCommand(CLI::App& app, int& exit_code);
void addSimulateCommand(CLI::App& app, int& exit_code);
void addSmoothCommand(CLI::App& app, int& exit_code);
void addViewCommand(CLI::App& app, int& exit_code);
void addVocabularyCommand(CLI::App& app, int& exit_code);
void addSettingsCommand(CLI::App& app, int& exit_code);
/// Call after all other commands have been added to `app`. Not listed in the help.
void addManCommand(CLI::App& app, int& exit_code);

}  // namespace swiftlet
