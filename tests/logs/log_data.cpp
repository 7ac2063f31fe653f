#include "tests/logs/log_data.hpp"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace swiftlet {

std::optional<std::string> findLog(const std::string& name) {
  const char* given = std::getenv("SWIFTLET_DATA");
  const std::filesystem::path root =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(SWIFTLET_SOURCE_DIR) / ".." / "shared" / "data";
  const std::filesystem::path path = (root / name).lexically_normal();
  if (std::filesystem::is_directory(path)) return path.string();
  std::fprintf(stderr, "log %s is not in %s: name the folder of logs in SWIFTLET_DATA\n", name.c_str(),
               root.c_str());
  return std::nullopt;
}

std::string shortLog() {
  return (std::filesystem::path(SWIFTLET_SOURCE_DIR) / "tests" / "data" / "euroc_mh01_4s").string();
}

}  // namespace swiftlet
