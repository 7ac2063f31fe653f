#pragma once
// What cannot run here says so in one line, and never counts as passed:
//
//   SKIPPED: WHAT: REASON; run with: COMMAND
//
// A Catch2 program with a skipped case and no failure ends with 77 (tests/main.cpp), which CTest lists as
// skipped; toolchain/skipped.sh collects the lines of a whole CTest run. Scripts print the same line.

#include <cstdio>
#include <string>

namespace swiftlet {

/// What CTest takes for skipped (SKIP_RETURN_CODE).
inline constexpr int kExitSkipped = 77;

/// For tests that want recorded logs: FOLDER is the one that holds them.
inline constexpr const char* kRunWithData = "SWIFTLET_DATA=FOLDER toolchain/test.sh";

/// `what` is a case or a part of it; empty: the whole test.
inline void printSkipped(const std::string& what, const std::string& reason, const std::string& command) {
  const char* const colon = what.empty() ? "" : ": ";
  // At the start of a line, whatever was printed before.
  std::printf("\nSKIPPED: %s%s%s; run with: %s\n", what.c_str(), colon, reason.c_str(), command.c_str());
  std::fflush(stdout);
}

}  // namespace swiftlet
