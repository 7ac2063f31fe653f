#include "drivers/recorded/log_warnings.hpp"

namespace swiftlet {

void LogWarnings::addCounted(std::uint64_t count, const std::string& line) {
  if (count < kPerKind) lines_.push_back(line);
  if (count == kPerKind) lines_.push_back(line + " (further warnings of this kind are only counted)");
}

}  // namespace swiftlet
