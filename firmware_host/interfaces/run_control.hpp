#pragma once
// How a caller stops a run and follows its progress.

#include <atomic>
#include <cstdint>
#include <functional>

namespace swiftlet {

struct RunControl {
  const std::atomic<bool>* stop = nullptr;  ///< when true: end cleanly after the current message
  /// Called with the number of images, or frames of tracks, taken so far.
  std::function<void(std::uint64_t)> progress;

  [[nodiscard]] bool stopped() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
};

}  // namespace swiftlet
