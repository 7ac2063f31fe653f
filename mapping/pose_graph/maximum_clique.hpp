#pragma once
// The largest set of loops that all agree with each other, among given candidates: exact by branch and bound
// within a number of visited nodes, otherwise the best found. The result tells which.
//
// 1. Core. Repeatedly removes candidates that agree with too few others to be in a set larger than
//    `at_least`. This removes most random false loops.
// 2. Candidates without conflicts are in the set. The others are renumbered (ascending), with their conflicts
//    as rows of bits: a consistent set is one without a conflict inside.
// 3. Peeling. Removes the candidate with most conflicts (the latest of equals) until no conflict is left,
//    then adds those that fit again, earliest first. This is the heuristic result.
// 4. Branch and bound. A node takes candidates with at most one conflict (always safe), drops those with too
//    many, and bounds the rest by a colouring: a group whose members all conflict contributes at most one.
//    Then the candidate with most conflicts (the latest of equals) is dropped, or taken.
//
// Deterministic: depends only on graph, candidates, `at_least` and `max_nodes`. Among sets of equal size the
// first found wins.
// Memory: capacity^2 / 8 bytes for the conflicts, 2 max_depth x capacity / 8 for the nodes, reserved by the
// constructor; no allocation afterwards. Cost of the core: some passes of m^2 / 64 words with m candidates;
// of a node: m'^2 / 64 words with m' candidates that have conflicts; peeling m'^2. Sources: Tomita and
// Kameda, "An efficient branch-and-bound algorithm for finding a maximum clique with computational
// experiments", J. Global Optimization 2007 (the colouring bound); San Segundo, Rodriguez-Losada, Jimenez,
// "An exact bit-parallel algorithm for the maximum clique problem", 2011 (on bits); the search on conflicts
// with its reductions is that of maximum independent sets (Akiba and Iwata, 2016).

#include <cstdint>
#include <vector>

#include "mapping/pose_graph/consistency_graph.hpp"

namespace swiftlet {

struct CliqueResult {
  std::uint32_t size = 0;   ///< 0: nothing larger than `at_least`
  bool exact = true;        ///< proven to be the largest
  std::uint32_t nodes = 0;  ///< visited
};

class MaximumClique {
 public:
  /// `max_depth` bounds the open nodes; deeper ones are skipped, and the result is then not exact.
  explicit MaximumClique(std::uint32_t capacity, std::uint32_t max_depth = kDefaultDepth);

  /// Searches a set larger than `at_least` among `candidates` (bits as in the graph's rows). `best` is
  /// overwritten if one is found.
  CliqueResult search(const ConsistencyGraph& graph, ConstBitSet candidates, std::uint32_t at_least,
                      std::uint32_t max_nodes, BitSet best);

  /// Larger than the number of nodes that a step may visit.
  static constexpr std::uint32_t kDefaultDepth = 512;

 private:
  struct Level {
    std::uint32_t size = 0;  ///< taken so far
    bool take_next = false;  ///< the branch that takes the vertex has not been visited
    std::uint32_t vertex = 0;
  };

  bool keepCore(const ConsistencyGraph& graph, std::uint32_t target);
  void numberConflicts(const ConsistencyGraph& graph);
  void peel();
  void bringBack(BitSet set);
  CliqueResult branch(std::uint32_t target, std::uint32_t max_nodes);
  bool reduce(BitSet open, BitSet taken, std::uint32_t& size, std::uint32_t target);
  [[nodiscard]] std::uint32_t colours(ConstBitSet open, std::uint32_t enough);
  [[nodiscard]] std::uint32_t mostConflicts(ConstBitSet open) const;

  [[nodiscard]] ConstBitSet conflicts(std::uint32_t k) const {
    return {conflicts_.data() + std::size_t{k} * words_, words_};
  }
  [[nodiscard]] BitSet openAt(std::uint32_t depth) {
    return {levels_bits_.data() + std::size_t{depth} * 2 * max_words_, words_};
  }
  [[nodiscard]] BitSet takenAt(std::uint32_t depth) {
    return {levels_bits_.data() + (std::size_t{depth} * 2 + 1) * max_words_, words_};
  }

  std::uint32_t max_words_;
  std::uint32_t max_depth_;
  std::uint32_t words_ = 0;                 ///< of the sets of numbered candidates
  std::vector<std::uint64_t> core_;         ///< in the graph's numbers
  std::vector<std::uint64_t> free_;         ///< members of the core without a conflict
  std::vector<std::uint32_t> numbers_;      ///< of the numbered candidates in the graph
  std::vector<std::uint64_t> conflicts_;    ///< rows
  std::vector<std::uint32_t> counts_;       ///< conflicts of each numbered candidate (scratch)
  std::vector<std::uint64_t> best_;         ///< numbered
  std::vector<std::uint64_t> scratch_;      ///< numbered
  std::vector<std::uint64_t> colour_;       ///< numbered
  std::vector<std::uint64_t> levels_bits_;  ///< open and taken candidates of each depth
  std::vector<Level> levels_;
};

}  // namespace swiftlet
