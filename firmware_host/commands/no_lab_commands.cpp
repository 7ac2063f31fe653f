#include "firmware_host/commands/lab_commands.hpp"

namespace swiftlet {

void addLabCommands(CLI::App& /*app*/, int& /*exit_code*/) {}

AccuracyOfRun labAccuracy() { return {}; }

}  // namespace swiftlet
