#pragma once
// Radius of known space around each cell of a window, as a lower bound.
//
// Computed on coarse cells of 2 x 2 x 2 cells, which are unknown if any of their cells is. Distances are
// measured from face to face, so the radius holds for every point of the cell. Everything outside the window
// is unknown. Memory: 0.6 bytes a cell. Cost: a tenth of NearestSeeds on the cells themselves. Errors: none.
// Not thread safe.

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "mapping/distance/nearest_seeds.hpp"

namespace swiftlet {

class KnownRange {
 public:
  static constexpr int kSide = 2;                                 ///< cells, of a coarse cell
  static constexpr int kAcross = NearestSeeds::kColumns / kSide;  ///< coarse cells along eight cells of x

  /// `cells`: multiples of 8. `reach` [cells]: search radius, at most kMostReach.
  KnownRange(const Eigen::Vector3i& cells, int reach);

  /// Sets the plane of coarse cells at coarse `y`. `unknownOf(block, z)` returns a bit for each of eight
  /// cells along x: whether it is unknown in any of the four rows of the coarse cells at coarse z.
  template <typename UnknownOf>
  void setPlane(int y, const UnknownOf& unknownOf);
  /// Call after all changed planes are set.
  void update();

  /// Radii [cells] of the cells x to x + 7 (x a multiple of 8) at z: kAcross values for every coarse y.
  [[nodiscard]] const std::uint8_t* line(int x, int z) const {
    return &range_[placeOf(x / kSide, z / kSide)];
  }
  [[nodiscard]] std::size_t bytes() const { return range_.size() + unknown_.bytes(); }

 private:
  [[nodiscard]] std::size_t placeOf(int x, int z) const {
    return static_cast<std::size_t>((x / kAcross * coarse_.z() + z) * coarse_.y() * kAcross);
  }
  void take(int x, int z);

  Eigen::Vector3i coarse_;
  int reach_;
  NearestSeeds unknown_;
  std::vector<std::uint8_t> range_;  ///< cells; by group of four along x, then z, y, and x in the group
};

template <typename UnknownOf>
void KnownRange::setPlane(int y, const UnknownOf& unknownOf) {
  for (int z = 0; z < coarse_.z(); ++z) {
    const auto row = unknown_.seeds(z);
    std::fill(row.begin(), row.end(), std::uint8_t{0});
    for (int block = 0; block < coarse_.x() / kAcross; ++block) {
      const std::uint8_t bits = unknownOf(block, z);
      std::uint32_t pairs = 0;
      for (int i = 0; i < kAcross; ++i) pairs |= (bits >> (kSide * i) & 3U) != 0 ? 1U << i : 0U;
      row[static_cast<std::size_t>(block / kSide)] |=
          static_cast<std::uint8_t>(pairs << (block % kSide * kAcross));
    }
  }
  unknown_.transformPlane(y);
}

}  // namespace swiftlet
