#pragma once
// The program as a function, for `main` and for tests.

namespace swiftlet {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;    ///< the run or the check failed
inline constexpr int kExitBadInput = 2;  ///< wrong use or bad input

/// The whole program: parses, runs, prints errors, returns the exit code.
int runProgram(int argc, char** argv);

}  // namespace swiftlet
