#pragma once
// `swiftlet` called from a test: its exit code, and what it says. In this process: a child that is forked
// from one with threads waits for ever for the pool of a linear algebra library.

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {

struct Said {
  int code = -1;
  std::string text;  ///< both streams, in the order of their lines
};

inline Said say(const std::vector<std::string>& arguments) {
  const ScratchFolder folder("said");
  const std::string file = folder.file("said.txt");
  const int out = open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT, 0600);
  const auto flush = [] {
    std::fflush(nullptr);
    std::cout.flush();
  };
  flush();
  constexpr std::array kStreams = {STDOUT_FILENO, STDERR_FILENO};
  std::array<int, kStreams.size()> before{};
  for (std::size_t i = 0; i < kStreams.size(); ++i) {
    before[i] = dup(kStreams[i]);
    dup2(out, kStreams[i]);
  }
  Said said;
  said.code = run(arguments);
  flush();
  for (std::size_t i = 0; i < kStreams.size(); ++i) {
    dup2(before[i], kStreams[i]);
    close(before[i]);
  }
  close(out);
  said.text = textOf(file);
  return said;
}

}  // namespace swiftlet::test
