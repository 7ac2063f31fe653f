#pragma once
// A live GStreamer source made of what a test gives it, as a camera's element would be: "feedsrc feed=0".
// Each image with the time of its capture, or none; errors, ends and starts that hang on demand.
//
// Threads: set() before the pipeline is opened; a feed's calls are of GStreamer's threads.

#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet::test {

struct FedImage {
  std::vector<std::uint8_t> bytes;
  std::optional<Stamp> capture;         ///< CLOCK_MONOTONIC; empty: the buffer has no PTS
  std::optional<std::uint64_t> number;  ///< for GST_BUFFER_OFFSET
  bool damaged = false;
};

class Feed {
 public:
  enum class Next : std::uint8_t { kWait, kImage, kError, kEnd };

  Feed() = default;
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;
  virtual ~Feed() = default;

  /// Asked every millisecond while it says kWait.
  virtual Next next(FedImage& image) = 0;
  /// True: the element's start does not return yet.
  virtual bool startHangs() { return false; }
};

/// Makes the element known, and feed number `feed` (0 or 1) `what`; null: none, the element gives nothing.
void setFeed(int feed, Feed* what);

}  // namespace swiftlet::test
