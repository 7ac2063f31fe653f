#pragma once
// Files that a run could not write: reported once on stderr and kept for later queries. The run continues.
//
// Threads: add() any, problem() and count() any, also while add() runs. Fixed memory, no lock.

#include <array>
#include <atomic>
#include <cstdint>
#include <string_view>

namespace swiftlet {

class LostFiles {
 public:
  static constexpr std::size_t kMostText = 400;  ///< bytes; most of the first text, a path and a reason

  /// `what` names the file and the reason.
  void add(std::string_view what);

  /// The first text, cut to kMostText; null: none so far. Valid and unchanged as long as this object.
  [[nodiscard]] const char* problem() const;
  [[nodiscard]] std::uint32_t count() const { return count_.load(std::memory_order_relaxed); }

 private:
  std::array<char, kMostText> text_{};
  std::atomic<bool> claimed_{false};
  std::atomic<bool> readable_{false};
  std::atomic<std::uint32_t> count_{0};
};

}  // namespace swiftlet
