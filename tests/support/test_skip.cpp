// What is skipped never counts as passed: exit codes of this very program, and the list of
// toolchain/skipped.sh.

#include <sys/wait.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/skip_case.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

/// Exit code of a shell command; its output goes to `said`.
int codeOf(const ScratchFolder& folder, const std::string& command, std::string& said) {
  const int status = std::system((command + " >'" + folder.file("said") + "' 2>&1").c_str());
  said = test::textOf(folder.file("said"));
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_CASE("a case that is skipped", "[.][child][skips]") {
  skipCase("no such device", "plug it in");
  CHECK(true);
}

TEST_CASE("a case that passes", "[.][child][passes]") { CHECK(true); }

TEST_CASE("a case that fails as often as a skipped one says", "[.][child][fails]") {
  for (int i = 0; i < kExitSkipped; ++i) CHECK(i < 0);
}

TEST_CASE("a program with a skipped case is skipped, unless a check fails") {
  const ScratchFolder folder("skip");
  const std::string self = "'" + std::filesystem::read_symlink("/proc/self/exe").string() + "' ";
  std::string said;
  CHECK(codeOf(folder, self + "[passes]", said) == 0);
  CHECK(said.find("SKIPPED") == std::string::npos);
  CHECK(codeOf(folder, self + "[passes],[skips]", said) == kExitSkipped);
  CHECK_THAT(said,
             Catch::Contains("\nSKIPPED: a case that is skipped: no such device; run with: plug it in\n"));
  CHECK(codeOf(folder, self + "[fails]", said) == 1);
  CHECK(codeOf(folder, self + "[skips],[fails]", said) == 1);
}

TEST_CASE("the list names test, reason and command, once, and a test that gives no reason") {
  const ScratchFolder folder("skip_list");
  std::filesystem::create_directories(folder.file("Testing/Temporary"));
  std::ofstream(folder.file("Testing/Temporary/LastTest.log"))
      << "1/3 Testing: camera\n1/3 Test: camera\nOutput:\nTest Passed.\n"
      << "2/3 Testing: imu\nOutput:\nSKIPPED: a: no log; run with: x\nSKIPPED: a: no log; run with: x\n"
      << "3/3 Testing: mute\nOutput:\n";
  std::ofstream(folder.file("ctest.log"))
      << "The following tests did not run:\n\t  2 - imu (Skipped)\n\t  3 - mute (Skipped)\n";
  std::string said;
  const std::string list = "'" SWIFTLET_SOURCE_DIR "/toolchain/skipped.sh' ";
  CHECK(codeOf(folder, list + "'" + folder.path() + "'", said) == 0);
  CHECK(said == "imu: a: no log; run with: x\n");
  CHECK(codeOf(folder, list + "'" + folder.path() + "' '" + folder.file("ctest.log") + "'", said) == 0);
  CHECK_THAT(said, Catch::StartsWith("imu: a: no log; run with: x\nmute: gives no reason"));
  CHECK(said.find("camera") == std::string::npos);
  CHECK(codeOf(folder, list + "/nowhere", said) == 2);
}

}  // namespace
}  // namespace swiftlet
