#include "firmware_host/commands/program.hpp"

#include <fmt/format.h>

#include <exception>
#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/lab_commands.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

/// An empty name would mean the current folder.
void refuseEmptyOut(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands({})) {
    if (CLI::Option* out = command->get_option_no_throw("--out")) {
      out->check([](const std::string& name) {
        return name.empty() ? std::string("the name is empty. Give a file or folder") : std::string();
      });
    }
    refuseEmptyOut(*command);
  }
}

}  // namespace

int runProgram(int argc, char** argv) {
  holdStandardStreams();
  CLI::App app("swiftlet: stereo-inertial state estimation for drones");
  app.set_version_flag("--version", versionText());
  app.require_subcommand(1);
  app.footer(
      "Example:\n  swiftlet replay data/euroc_mh01_20s --out run_mh01\n"
      "`swiftlet <command> --help` explains each command.");
  int exit_code = kExitDone;
  addReplayCommand(app, exit_code);
  addFlyCommand(app, exit_code);
  addSmoothCommand(app, exit_code);
  addRecordCommand(app, exit_code);
  addDoctorCommand(app, exit_code);
  addCalibrationCommand(app, exit_code);
  addSettingsCommand(app, exit_code);
  addLabCommands(app, exit_code);
  addManCommand(app, exit_code);
  refuseEmptyOut(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitBadInput;
  } catch (const InputError& error) {
    warn(fmt::format("error: {}\n", error.what()));
    return kExitBadInput;
  } catch (const std::filesystem::filesystem_error& error) {
    warn(fmt::format("error: {}: {}. Check that this path exists and that you may read and write it\n",
                     error.path1().string(), error.code().message()));
    return kExitBadInput;
  } catch (const std::exception& error) {
    warn(fmt::format("error: {}\n", error.what()));
    return kExitFailed;
  }
  return exit_code;
}

}  // namespace swiftlet
