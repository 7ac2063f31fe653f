#pragma once
// Files in which a machine describes itself and the rights it grants. Private to this folder.

#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "firmware_host/realtime/machine_report.hpp"

namespace swiftlet {

/// The files of one machine, real or simulated.
class Machine {
 public:
  explicit Machine(std::string root) : root_(std::move(root)) {}

  /// The whole file without the white space at its end.
  [[nodiscard]] std::optional<std::string> text(const std::string& path) const {
    std::ifstream file(root_ + path);
    if (!file) return std::nullopt;
    std::ostringstream content;
    content << file.rdbuf();
    std::string all = content.str();
    while (!all.empty() && std::isspace(static_cast<unsigned char>(all.back())) != 0) all.pop_back();
    return all;
  }
  [[nodiscard]] std::optional<std::int64_t> number(const std::string& path) const {
    const auto content = text(path);
    return content ? toNumber(*content) : std::nullopt;
  }
  /// The rest of the first line that begins with `start`.
  [[nodiscard]] std::optional<std::string> lineAfter(const std::string& path, std::string_view start) const {
    const auto content = text(path);
    if (!content) return std::nullopt;
    std::istringstream lines(*content);
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(start)) return line.substr(start.size());
    }
    return std::nullopt;
  }

  /// Whether the capability is in the effective set of the thread whose status file this is.
  [[nodiscard]] std::optional<bool> hasCapability(const std::string& status, unsigned capability) const {
    const auto effective = lineAfter(status, "CapEff:");
    if (!effective) return std::nullopt;
    constexpr int kHexadecimal = 16;
    return (std::strtoull(effective->c_str(), nullptr, kHexadecimal) >> capability & 1U) != 0;
  }

  static std::optional<std::int64_t> toNumber(const std::string& text) {
    char* end = nullptr;
    const std::int64_t value = std::strtoll(text.c_str(), &end, 10);
    const bool whole =
        end != text.c_str() && (*end == '\0' || std::isspace(static_cast<unsigned char>(*end)));
    return whole ? std::optional(value) : std::nullopt;
  }

 private:
  std::string root_;
};

inline MachineLine unknown(const char* what) { return {what, "unknown", MachineVerdict::kUnknown, ""}; }

/// Whether a sleeping CPU wakes quickly.
MachineLine idleStates(const Machine& machine);
/// Which CPU handles the devices' interrupts.
MachineLine interrupts(const Machine& machine);

}  // namespace swiftlet
