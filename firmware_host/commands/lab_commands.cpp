#include "firmware_host/commands/lab_commands.hpp"

#include "drivers/target/target_file.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/lab/calibrate/guidance/guided_recording.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {

void addLabCommands(CLI::App& app, int& exit_code) {
  addCalibrateCommand(app, exit_code);
  addSimulateCommand(app, exit_code);
  addImportCommand(app, exit_code);
  addHilCommand(app, exit_code);
  addEvaluateCommand(app, exit_code);
  addCampaignCommand(app, exit_code);
  addExportCommand(app, exit_code);
  addReportCommand(app, exit_code);
  addViewCommand(app, exit_code);
  addMeshCommand(app, exit_code);
  addFuseCommand(app, exit_code);
  addMapCommand(app, exit_code);
  addPlaceCommand(app, exit_code);
  addPoseGraphCommand(app, exit_code);
  addBudgetCommand(app, exit_code);
  addVocabularyCommand(app, exit_code);
}

AccuracyOfRun labAccuracy() { return runAccuracyJson; }

std::unique_ptr<RecordWatcher> labGuidance(const std::string& board, const std::optional<ViewAddress>& view) {
  return std::make_unique<GuidedRecording>(
      readTarget(board), [](const std::string& line) { say(line + "\n"); }, view);
}

}  // namespace swiftlet
