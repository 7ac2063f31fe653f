#include "mapping/distance/known_range.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {

KnownRange::KnownRange(const Eigen::Vector3i& cells, int reach)
    : coarse_(cells / kSide),
      reach_(reach),
      unknown_(coarse_, reach / kSide + 1, 1),
      range_(static_cast<std::size_t>(coarse_.prod())) {}

void KnownRange::update() {
  for (int x = 0; x < coarse_.x(); x += NearestSeeds::kColumns) {
    for (int z = 0; z < coarse_.z(); z += NearestSeeds::kLayers) take(x, z);
  }
}

/// Computes the radii of the coarse cells x to x + 7, z and z + 1, for every y.
void KnownRange::take(int x, int z) {
  const auto lines = unknown_.transformLines(x, z);
  const int columns = std::min(NearestSeeds::kColumns, coarse_.x() - x);
  for (int layer = 0; layer < NearestSeeds::kLayers; ++layer) {
    for (int column = 0; column < columns; ++column) {
      std::uint8_t* range = &range_[placeOf(x + column, z + layer)] + column % kAcross;
      const auto cellsToEdge = [](int at, int count) { return std::min(at, count - 1 - at); };
      const int edge = std::min(cellsToEdge(x + column, coarse_.x()), cellsToEdge(z + layer, coarse_.z()));
      for (int y = 0; y < coarse_.y(); ++y, range += kAcross) {
        const NearestSeeds::Word word = lines[static_cast<std::size_t>(y)][static_cast<std::size_t>(layer)]
                                             [static_cast<std::size_t>(column)];
        const float gap = std::sqrt(static_cast<float>(NearestSeeds::squaredOf(word)));
        const int to_edge = std::min(edge, cellsToEdge(y, coarse_.y()));
        *range =
            static_cast<std::uint8_t>(std::min({static_cast<int>(gap * kSide), kSide * to_edge, reach_}));
      }
    }
  }
}

}  // namespace swiftlet
