#include "firmware_host/files/lost_files.hpp"

#include <algorithm>
#include <cstdio>

namespace swiftlet {

void LostFiles::add(std::string_view what) {
  count_.fetch_add(1, std::memory_order_relaxed);
  // A missing terminal is no reason to fail: the result is ignored.
  std::fprintf(stderr, "warning: %.*s (the run continues without it)\n", static_cast<int>(what.size()),
               what.data());
  if (claimed_.exchange(true, std::memory_order_relaxed)) return;
  const std::size_t size = std::min(what.size(), text_.size() - 1);
  std::copy_n(what.data(), size, text_.data());
  readable_.store(true, std::memory_order_release);
}

const char* LostFiles::problem() const {
  return readable_.load(std::memory_order_acquire) ? text_.data() : nullptr;
}

}  // namespace swiftlet
