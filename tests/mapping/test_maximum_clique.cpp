#include "mapping/pose_graph/maximum_clique.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kManyNodes = 1000000;

ConsistencyGraph randomGraph(std::uint32_t size, double share, Random& random) {
  ConsistencyGraph graph(size);
  for (std::uint32_t a = 0; a < size; ++a) {
    for (std::uint32_t b = 0; b < a; ++b) {
      if (random.uniform() < share) {
        graph.connect(a, b);
      }
    }
  }
  return graph;
}

std::vector<std::uint64_t> all(const ConsistencyGraph& graph) {
  std::vector<std::uint64_t> set(graph.words());
  for (std::uint32_t k = 0; k < graph.capacity(); ++k) {
    setBit(set, k);
  }
  return set;
}

/// Of all sets, by taking and leaving each number. At most 64.
std::uint32_t bruteForce(const ConsistencyGraph& graph, std::uint64_t candidates) {
  if (candidates == 0) {
    return 0;
  }
  const auto k = static_cast<std::uint32_t>(std::countr_zero(candidates));
  const std::uint64_t rest = candidates & (candidates - 1);
  const std::uint32_t with = 1 + bruteForce(graph, rest & graph.row(k)[0]);
  return (rest & ~graph.row(k)[0]) == 0 ? with : std::max(with, bruteForce(graph, rest));
}

bool agrees(const ConsistencyGraph& graph, ConstBitSet set) {
  bool all_agree = true;
  forEachBit(set, [&](std::uint32_t a) {
    forEachBit(set, [&](std::uint32_t b) { all_agree = all_agree && (a == b || graph.consistent(a, b)); });
  });
  return all_agree;
}

TEST_CASE("The largest clique is that of trying all sets", "[pose_graph]") {
  Random random(7);
  for (int trial = 0; trial < 300; ++trial) {
    const std::uint32_t size = 1 + random.below(30);
    const ConsistencyGraph graph = randomGraph(size, random.uniform(), random);
    MaximumClique clique(size);
    std::vector<std::uint64_t> best(graph.words());
    const std::vector<std::uint64_t> candidates = all(graph);
    const CliqueResult result = clique.search(graph, candidates, 0, kManyNodes, best);
    const std::uint32_t truth = bruteForce(graph, candidates[0]);
    CAPTURE(size, truth);
    REQUIRE(result.exact);
    REQUIRE(result.size == truth);
    REQUIRE(countBits(best) == truth);
    REQUIRE(agrees(graph, best));
    // One less is beaten, as many is not.
    std::vector<std::uint64_t> again(graph.words());
    CHECK(clique.search(graph, candidates, truth - 1, kManyNodes, again).size == truth);
    CHECK(clique.search(graph, candidates, truth, kManyNodes, again).size == 0);
  }
}

TEST_CASE("A planted clique among many loops is found, exactly and quickly", "[pose_graph]") {
  Random random(8);
  constexpr std::uint32_t kSize = 600;
  ConsistencyGraph graph = randomGraph(kSize, 0.3, random);
  for (std::uint32_t a = 0; a < kSize; a += 3) {
    for (std::uint32_t b = 0; b < a; b += 3) {
      graph.connect(a, b);
    }
  }
  MaximumClique clique(kSize);
  std::vector<std::uint64_t> best(graph.words());
  const CliqueResult result = clique.search(graph, all(graph), 0, 100, best);
  CHECK(result.exact);
  CHECK(result.size >= kSize / 3);
  for (std::uint32_t a = 0; a < kSize; a += 3) {
    CHECK(testBit(best, a));
  }
}

TEST_CASE("Out of nodes the answer is a clique, said not to be exact, and the same every time",
          "[pose_graph]") {
  Random random(9);
  constexpr std::uint32_t kSize = 300;
  const ConsistencyGraph graph = randomGraph(kSize, 0.9, random);
  std::uint32_t before = 0;
  for (const std::uint32_t nodes : {0U, 10U, 1000U}) {
    MaximumClique clique(kSize);
    std::vector<std::uint64_t> first(graph.words());
    std::vector<std::uint64_t> second(graph.words());
    const CliqueResult result = clique.search(graph, all(graph), 0, nodes, first);
    const CliqueResult again = clique.search(graph, all(graph), 0, nodes, second);
    CHECK_FALSE(result.exact);
    CHECK(result.nodes == nodes);
    CHECK(result.size >= std::max(before, 20U));
    CHECK(agrees(graph, first));
    CHECK(countBits(first) == result.size);
    CHECK(again.size == result.size);
    CHECK(first == second);
    before = result.size;
  }
}

}  // namespace
}  // namespace swiftlet
