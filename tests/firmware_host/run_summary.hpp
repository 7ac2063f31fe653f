#pragma once
// What a run says of itself at its end.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/text.hpp"

namespace swiftlet::test {

inline nlohmann::json summaryIn(const std::string& run_folder) {
  return nlohmann::json::parse(textOf(std::filesystem::path(run_folder) / "summary.json"));
}

}  // namespace swiftlet::test
