#pragma once
// A run folder to export: a few seconds of simulated tracks, replayed with everything a run can hold of them.

#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware_host/commands/command.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {

/// Made once a program, copied for each test.
struct ExportedRun {
  ExportedRun() : folder("export"), run(folder.file("run")) {
    static const ScratchFolder made("export_made");
    static const std::string flight = made.file("flight");
    static const std::string original = made.file("run");
    if (!std::filesystem::exists(original)) {
      REQUIRE(test::run({"simulate", "--tracks", "--duration", "5", "--seed", "7", "--out", flight}) ==
              kExitDone);
      REQUIRE(test::run({"replay", flight, "--imu-rate", "--mesh-sequence", "--out", original}) == kExitDone);
    }
    std::filesystem::copy(original, run, std::filesystem::copy_options::recursive);
  }

  ScratchFolder folder;
  std::string run;
};

}  // namespace swiftlet::test
