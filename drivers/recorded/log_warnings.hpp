#pragma once
// Counters and messages about problems found while reading a log: counters for the summary, lines for the
// user. Readers drop nothing without recording it here.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/core/limits.hpp"

namespace swiftlet {

struct LogCounters {
  std::uint64_t imu_samples = 0;                    ///< delivered
  std::array<std::uint64_t, kMaxCameras> images{};  ///< delivered
  std::uint64_t bad_rows = 0;                       ///< rows that do not match the file's format, skipped
  std::uint64_t nan_rows = 0;                       ///< rows with NaN or infinity, skipped
  std::uint64_t out_of_order = 0;     ///< rows or messages earlier than one before them, put in order
  std::uint64_t repeated_stamps = 0;  ///< rows with the stamp of an earlier row, skipped
  std::uint64_t missing_images = 0;   ///< listed files that do not exist, skipped
  std::uint64_t damaged_images = 0;   ///< truncated, of another size or undecodable, skipped
};

/// Lines for the user, at most `kPerKind` of each kind, so that a damaged log does not flood the screen.
class LogWarnings {
 public:
  static constexpr std::uint64_t kPerKind = 5;

  /// Adds a line unless `count`, the kind's counter after the event, is above kPerKind.
  void addCounted(std::uint64_t count, const std::string& line);
  void add(const std::string& line) { lines_.push_back(line); }
  [[nodiscard]] const std::vector<std::string>& lines() const { return lines_; }

 private:
  std::vector<std::string> lines_;
};

}  // namespace swiftlet
