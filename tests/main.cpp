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

#if defined(__SANITIZE_THREAD__)
/// The locks of GLib are bare calls of the kernel, which the sanitizer does not know.
extern "C" const char* __tsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier): its name
  return "called_from_lib:libglib-2.0.so\ncalled_from_lib:libgstreamer-1.0.so\n";
}
#endif

int main(int argc, char** argv) {
  // Catch2 returns the number of failures: 77 of them would be taken for a skipped test.
  if (Catch::Session().run(argc, argv) != 0) return 1;
  return swiftlet::g_skipped ? swiftlet::kExitSkipped : 0;
}
