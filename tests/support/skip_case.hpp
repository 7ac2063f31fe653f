#pragma once
// Skips a Catch2 case, or a part of one, of a program whose main is tests/main.cpp.

#include <string>

#include "tests/support/skip.hpp"

namespace swiftlet {

/// Prints the line of skip.hpp with the running case's name, and lets the program end with 77 unless a check
/// fails. The case goes on: return after it unless the rest can run.
void skipCase(const std::string& reason, const std::string& command);

}  // namespace swiftlet
