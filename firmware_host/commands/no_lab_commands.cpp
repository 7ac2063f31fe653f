#include "firmware_host/commands/lab_commands.hpp"

#include "drivers/input/input_error.hpp"

namespace swiftlet {

void addLabCommands(CLI::App& /*app*/, int& /*exit_code*/) {}

AccuracyOfRun labAccuracy() { return {}; }

std::unique_ptr<RecordWatcher> labGuidance(const std::string& /*board*/,
                                           const std::optional<ViewAddress>& /*view*/) {
  throw InputError("record", 0, "--calibrate", "this build has no detector for calibration boards",
                   "Record without --calibrate, or build with SWIFTLET_BUILD_LAB=ON");
}

}  // namespace swiftlet
