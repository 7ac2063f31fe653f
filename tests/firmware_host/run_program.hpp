#pragma once
// `swiftlet` called from a test as a shell calls it.

#include <string>
#include <vector>

#include "firmware_host/commands/program.hpp"

namespace swiftlet::test {

/// Without the program's name; gives the exit code.
inline int run(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "swiftlet");
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  return runProgram(static_cast<int>(pointers.size()), pointers.data());
}

}  // namespace swiftlet::test
