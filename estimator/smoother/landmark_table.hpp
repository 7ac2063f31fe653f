#pragma once
// The landmarks of the window: storage, search by id, admission and removal.
//
// A landmark keeps its index until it is removed; a new one gets the lowest free index. Iteration is in the
// order of indices, so that sums do not depend on the history. When full (kMaxLandmarks), the landmark that
// was lost longest ago is removed; explicit landmarks leave by other rules (extra_table.hpp). Memory: 2.1
// MiB, reserved by the constructor. Cost: a search is logarithmic; adding one with an id above all others is
// O(1) until the table is full.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/landmark.hpp"

namespace swiftlet {

class LandmarkTable {
 public:
  template <typename Table, typename Value>
  class Iterator {
   public:
    Iterator(Table& table, std::size_t index) : table_(table), index_(index) {}
    Value& operator*() const { return table_[index_]; }
    Iterator& operator++() {
      index_ = table_.usedFrom(index_ + 1);
      return *this;
    }
    bool operator!=(const Iterator& other) const { return index_ != other.index_; }

   private:
    Table& table_;
    std::size_t index_;
  };

  LandmarkTable() : landmarks_(kMaxLandmarks) {}

  void clear();
  /// Null if there is none with this id.
  [[nodiscard]] Landmark* find(TrackId id);
  [[nodiscard]] const Landmark* find(TrackId id) const { return const_cast<LandmarkTable*>(this)->find(id); }
  /// Adds an empty landmark; `id` must be new.
  Landmark& add(TrackId id);
  void remove(Landmark& landmark);
  /// Removes the observations of a state that left, and landmarks without observations, except explicit ones.
  void removeSightingsOf(std::uint32_t slot);

  [[nodiscard]] std::size_t indexOf(const Landmark& landmark) const {
    return static_cast<std::size_t>(&landmark - landmarks_.data());
  }
  Landmark& operator[](std::size_t index) { return landmarks_[index]; }
  const Landmark& operator[](std::size_t index) const { return landmarks_[index]; }

  /// The current landmark may be removed during the iteration.
  [[nodiscard]] auto begin() { return Iterator<LandmarkTable, Landmark>(*this, usedFrom(0)); }
  [[nodiscard]] auto end() { return Iterator<LandmarkTable, Landmark>(*this, kMaxLandmarks); }
  [[nodiscard]] auto begin() const {
    return Iterator<const LandmarkTable, const Landmark>(*this, usedFrom(0));
  }
  [[nodiscard]] auto end() const {
    return Iterator<const LandmarkTable, const Landmark>(*this, kMaxLandmarks);
  }

 private:
  static constexpr std::size_t kBits = 64;
  static_assert(kMaxLandmarks % kBits == 0);

  struct Entry {
    TrackId id = 0;
    std::uint32_t index = 0;
  };

  [[nodiscard]] std::size_t usedFrom(std::size_t index) const;
  [[nodiscard]] std::size_t lowestFree() const;
  [[nodiscard]] Entry* entryFrom(TrackId id);
  void makeRoom();

  std::vector<Landmark> landmarks_;
  std::array<std::uint64_t, kMaxLandmarks / kBits> used_{};
  FixedVector<Entry, kMaxLandmarks> by_id_;  // ascending
};

}  // namespace swiftlet
