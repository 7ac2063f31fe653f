// The main of all Catch2 programs: exit code 0 passed, 1 failed, 77 nothing failed but a case was skipped.

#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

bool g_skipped = false;

}  // namespace

void skipCase(const std::string& reason, const std::string& command) {
  g_skipped = true;
  printSkipped(Catch::getResultCapture().getCurrentTestName(), reason, command);
}

}  // namespace swiftlet

int main(int argc, char** argv) {
  // Catch2 returns the number of failures: 77 of them would be taken for a skipped test.
  if (Catch::Session().run(argc, argv) != 0) return 1;
  return swiftlet::g_skipped ? swiftlet::kExitSkipped : 0;
}
