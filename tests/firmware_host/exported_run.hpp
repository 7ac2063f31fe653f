#pragma once
// A run folder to export: a few seconds of simulated tracks, replayed with everything a run can hold of them.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "firmware_host/commands/command.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet::test {

inline std::string textOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

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
