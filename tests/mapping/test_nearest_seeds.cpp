// The transform of a window beside brute force over all seeds: distances and the seeds that it names.

#include "mapping/distance/nearest_seeds.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "estimator/core/random.hpp"

using namespace swiftlet;

namespace {

struct Case {
  Eigen::Vector3i cells;
  int reach;
  int gap;
  int seeds;
};

struct Planes {
  Planes(const Case& given, Random& random)
      : transform(given.cells, given.reach, given.gap), layers(given.cells.z()) {
    for (int i = 0; i < given.seeds; ++i) {
      seeds.emplace_back();
      for (int axis = 0; axis < 3; ++axis)
        seeds.back()[axis] = static_cast<int>(random.uniform(0, given.cells[axis] - 1e-9));
    }
    for (int y = 0; y < given.cells.y(); ++y) give(y);
  }

  void give(int y) {
    for (int z = 0; z < layers; ++z) {
      const auto row = transform.seeds(z);
      std::fill(row.begin(), row.end(), std::uint8_t{0});
      for (const Eigen::Vector3i& seed : seeds) {
        if (seed.y() != y || seed.z() != z) continue;
        row[static_cast<std::size_t>(seed.x() / 8)] |= static_cast<std::uint8_t>(1U << (seed.x() % 8));
      }
    }
    transform.transformPlane(y);
  }

  NearestSeeds transform;
  int layers;
  std::vector<Eigen::Vector3i> seeds;
};

int squaredBetween(const Eigen::Vector3i& a, const Eigen::Vector3i& b, int gap) {
  return ((a - b).array().abs() - gap).max(0).square().sum();
}

int squaredToNearest(const Planes& planes, const Eigen::Vector3i& cell, int gap) {
  int best = 1 << 20;
  for (const Eigen::Vector3i& seed : planes.seeds) best = std::min(best, squaredBetween(seed, cell, gap));
  return best;
}

template <typename Visit>
void forCells(const Case& given, Planes& planes, const Visit& visit) {
  for (int x = 0; x < given.cells.x(); x += NearestSeeds::kColumns) {
    for (int z = 0; z < given.cells.z(); z += NearestSeeds::kLayers) {
      const auto lines = planes.transform.transformLines(x, z);
      for (int at = 0; at < given.cells.y() * NearestSeeds::kLayers * NearestSeeds::kColumns; ++at) {
        const int column = at % NearestSeeds::kColumns, rest = at / NearestSeeds::kColumns;
        const int layer = rest % NearestSeeds::kLayers, y = rest / NearestSeeds::kLayers;
        if (x + column >= given.cells.x()) continue;
        visit(Eigen::Vector3i(x + column, y, z + layer),
              lines[static_cast<std::size_t>(y)][static_cast<std::size_t>(layer)]
                   [static_cast<std::size_t>(column)]);
      }
    }
  }
}

}  // namespace

TEST_CASE("distances within reach are exact and lead to a seed") {
  Random random(4);
  const std::vector<Case> cases{{{28, 20, 16}, 9, 0, 0},   {{28, 20, 16}, 9, 0, 1},
                                {{28, 20, 16}, 9, 0, 40},  {{24, 33, 12}, 20, 0, 6},
                                {{16, 130, 10}, 60, 0, 3}, {{130, 16, 10}, 60, 0, 3},
                                {{10, 16, 130}, 60, 0, 3}, {{28, 20, 16}, 9, 1, 20},
                                {{28, 20, 16}, 21, 1, 5},  {{24, 16, 16}, 12, 0, 3000}};
  for (const Case& given : cases) {
    Planes planes(given, random);
    int wrong = 0, astray = 0, beyond = 0;
    const int within = (given.reach - given.gap) * (given.reach - given.gap);
    forCells(given, planes, [&](const Eigen::Vector3i& cell, NearestSeeds::Word word) {
      const int squared = NearestSeeds::squaredOf(word);
      const int truth = squaredToNearest(planes, cell, given.gap);
      if (truth > within) {
        beyond += squared <= within ? 1 : 0;
        return;
      }
      wrong += squared == truth ? 0 : 1;
      if (given.gap != 0) return;
      const Eigen::Vector3i steps(NearestSeeds::xOf(word), NearestSeeds::yOf(word), NearestSeeds::zOf(word));
      const auto at = std::find(planes.seeds.begin(), planes.seeds.end(), cell + steps);
      astray += at != planes.seeds.end() && steps.squaredNorm() == truth ? 0 : 1;
    });
    CAPTURE(given.cells.transpose(), given.reach, given.gap, given.seeds);
    CHECK(wrong == 0);
    CHECK(astray == 0);
    CHECK(beyond == 0);
  }
}

TEST_CASE("a plane given again counts, the others are kept") {
  Random random(5);
  const Case given{{24, 20, 16}, 12, 0, 30};
  Planes planes(given, random);
  for (int round = 0; round < 10; ++round) {
    const int y = static_cast<int>(random.uniform(0, 20 - 1e-9));
    std::erase_if(planes.seeds, [&](const Eigen::Vector3i& seed) { return seed.y() == y; });
    planes.seeds.emplace_back(static_cast<int>(random.uniform(0, 24 - 1e-9)), y, 3);
    planes.give(y);
    int wrong = 0;
    forCells(given, planes, [&](const Eigen::Vector3i& cell, NearestSeeds::Word word) {
      const int truth = squaredToNearest(planes, cell, 0);
      wrong += truth <= 144 && NearestSeeds::squaredOf(word) != truth ? 1 : 0;
    });
    CHECK(wrong == 0);
  }
}
