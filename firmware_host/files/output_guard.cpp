#include "firmware_host/files/output_guard.hpp"

#include <algorithm>
#include <filesystem>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

/// Absolute, without links and without a slash at the end.
fs::path placeOf(const std::string& name) {
  std::error_code error;
  fs::path place = fs::weakly_canonical(fs::absolute(name), error);
  if (error) place = fs::absolute(name).lexically_normal();
  return place.has_filename() ? place : place.parent_path();
}

}  // namespace

void refuseOutputInInput(const std::string& output, const std::vector<std::string>& inputs) {
  if (output.empty()) return;
  const fs::path out = placeOf(output);
  for (const std::string& input : inputs) {
    if (input.empty()) continue;
    const fs::path in = placeOf(input);
    if (std::mismatch(in.begin(), in.end(), out.begin(), out.end()).first != in.end()) continue;
    throw InputError(output, 0, "--out",
                     in == out ? "would overwrite the input " + input : "lies inside the input " + input,
                     "Give another place with --out");
  }
}

}  // namespace swiftlet
