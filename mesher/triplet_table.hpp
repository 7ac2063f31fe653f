#pragma once
// Hash table of faces by their three vertices, in any order. Memory: 20 bytes per entry and twice as many
// entries as faces, reserved by the constructor. clear() is O(1).

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace swiftlet {

class TripletTable {
 public:
  using Triplet = std::array<std::uint32_t, 3>;
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;

  explicit TripletTable(std::size_t capacity) : capacity_(capacity) {
    std::size_t places = 1;
    while (places < 2 * capacity) places *= 2;
    places_.resize(places);
  }

  void clear() {
    ++filling_;
    size_ = 0;
  }

  /// The value of the triplet, or kNone.
  [[nodiscard]] std::uint32_t find(const Triplet& triplet) const {
    const Triplet key = inOrder(triplet);
    const Place& place = places_[placeOf(key)];
    return place.filling == filling_ ? place.value : kNone;
  }

  /// False, without effect, if the triplet exists or the table is full.
  bool insert(const Triplet& triplet, std::uint32_t value) {
    const Triplet key = inOrder(triplet);
    Place& place = places_[placeOf(key)];
    if (place.filling == filling_ || size_ == capacity_) return false;
    place = {key, value, filling_};
    ++size_;
    return true;
  }

 private:
  struct Place {
    Triplet key{};
    std::uint32_t value = 0;
    std::uint64_t filling = 0;  ///< entries of earlier fillings are free
  };

  static Triplet inOrder(Triplet t) {
    if (t[0] > t[1]) std::swap(t[0], t[1]);
    if (t[1] > t[2]) std::swap(t[1], t[2]);
    if (t[0] > t[1]) std::swap(t[0], t[1]);
    return t;
  }

  /// The triplet's entry, or the free one where it belongs. At least half of the entries are free.
  [[nodiscard]] std::size_t placeOf(const Triplet& key) const {
    std::uint64_t hash = 0;
    // Multiplication by 2^64 / golden ratio spreads consecutive numbers (Knuth, TAOCP 3, 6.4).
    for (const std::uint32_t k : key) hash = (hash ^ k) * 0x9E3779B97F4A7C15ULL;
    const std::size_t mask = places_.size() - 1;
    std::size_t at = static_cast<std::size_t>(hash >> 32) & mask;
    while (places_[at].filling == filling_ && places_[at].key != key) at = (at + 1) & mask;
    return at;
  }

  std::size_t capacity_;
  std::size_t size_ = 0;
  std::uint64_t filling_ = 1;
  std::vector<Place> places_;
};

}  // namespace swiftlet
