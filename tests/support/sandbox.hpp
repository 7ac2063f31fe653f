#pragma once
// What a test inside the kernel sandbox asks of its surroundings: the devices' names, and what it left open.

#include <catch2/catch.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace swiftlet::sandbox {

/// "SANDBOX_CAMERA0" and so on. Fails the test outside.
inline std::string device(const char* name) {
  const char* path = std::getenv(name);
  INFO(name << " is not set: run this through toolchain/kernel_sandbox/run.sh");
  REQUIRE(path != nullptr);
  return path;
}

inline std::size_t openFiles() {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    count += entry.exists() ? 1 : 0;
  return count;
}

/// Mappings of files whose name begins so.
inline std::size_t mappings(const std::string& prefix) {
  std::ifstream maps("/proc/self/maps");
  std::size_t count = 0;
  for (std::string line; std::getline(maps, line);)
    count += line.find(" " + prefix) != std::string::npos ? 1 : 0;
  return count;
}

}  // namespace swiftlet::sandbox
