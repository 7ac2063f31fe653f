#pragma once
// Matches features of two keyframes by brute force over 256-bit descriptors.
//
// A match is the nearest descriptor by number of differing bits, not farther than `max_distance`, clearly
// nearer than the next one (ratio test; Lowe, IJCV 2004), and the nearest in the other direction too. A rival
// within `same_spot` pixels of the best does not count, because one corner may be found in several octaves.
// If vocabulary nodes are given, only features below the same node are compared.
//
// Deterministic: equal distances go to the smaller index. No allocation; memory: the object, 22 KiB. 512 x
// 512 features take about 0.4 ms. docs/place.md.

#include <array>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

struct DescriptorMatch {
  std::uint16_t old_feature = 0;  ///< index in the old keyframe's features
  std::uint16_t new_feature = 0;  ///< in the new one's
  std::uint16_t distance = 0;     ///< bits
  bool operator==(const DescriptorMatch&) const = default;
};

using DescriptorMatches = FixedVector<DescriptorMatch, kMaxPlaceFeatures>;
using PlaceFeatures = FixedVector<PlaceFeature, kMaxPlaceFeatures>;

struct DescriptorMatchSettings {
  int max_distance = 64;   ///< bits; unrelated patches differ in 128 +- 8 if bits are independent
  float ratio = 0.85F;     ///< best / next; 1 or more: no test
  float same_spot = 4.0F;  ///< px
  bool mutual = true;      ///< nearest in both directions
};

class DescriptorMatcher {
 public:
  /// Vocabulary nodes, one per feature, or empty for all against all.
  using Nodes = std::span<const std::uint32_t>;

  /// Matches are in the order of the old features. kInvalidInput if nodes are given for only a part of the
  /// features; `matches` is then empty.
  Status match(const PlaceFeatures& old_features, const PlaceFeatures& new_features,
               const DescriptorMatchSettings& settings, DescriptorMatches& matches, Nodes old_nodes = {},
               Nodes new_nodes = {});

 private:
  struct Range {
    std::size_t first = 0, last = 0;  ///< positions in the sorted order
  };
  struct Nearest {
    std::uint16_t place = 0, distance = 0;
  };
  void loadNew(const PlaceFeatures& new_features, Nodes nodes);
  [[nodiscard]] Range rangeOf(std::uint32_t node, bool all) const;
  void fillRow(const Descriptor& descriptor, Range range);
  [[nodiscard]] Nearest nearestInRow(Range range) const;
  [[nodiscard]] bool unique(const PlaceFeatures& new_features, Range range, Nearest nearest,
                            const DescriptorMatchSettings& settings) const;

  std::size_t count_ = 0;
  std::array<std::array<std::uint64_t, kMaxPlaceFeatures>, 4> words_{};  ///< of the new features, sorted
  std::array<std::uint16_t, kMaxPlaceFeatures> order_{};                 ///< feature at each sorted position
  std::array<std::uint32_t, kMaxPlaceFeatures> node_{};                  ///< node at each position, ascending
  std::array<std::uint16_t, kMaxPlaceFeatures> row_{};                   ///< distances of one old feature
  std::array<std::uint16_t, kMaxPlaceFeatures> nearest_old_{};  ///< nearest old feature of each position
  std::array<std::uint16_t, kMaxPlaceFeatures> nearest_distance_{};
};

}  // namespace swiftlet
