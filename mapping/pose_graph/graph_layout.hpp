#pragma once
// Which poses of a graph are unknowns, and to which block of the normal equations each edge contributes.
//
// Held poses are constants. A piece of the graph (poses joined by edges) without a held pose is held by its
// first pose, because its position relative to other pieces is not determined. If a pose of such a piece
// knows the vertical, its first pose is an unknown with heading and position anchored.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/pose_graph/block_structure.hpp"

namespace swiftlet {

struct GraphLayout {
  static constexpr std::uint32_t kHeld = 0xffffffffU;
  static constexpr std::uint32_t kNoPair = 0xffffffffU;

  std::vector<std::uint32_t> unknown;    ///< of each pose: number of its block, or kHeld
  std::vector<std::uint32_t> edge_pair;  ///< of each edge: its pair, kNoPair if an end is held
  std::vector<bool> edge_reversed;       ///< the pair is (to, from)
  std::vector<BlockPair> pairs;          ///< of unknowns, first < second, ascending
  std::uint32_t unknowns = 0;
  std::uint32_t pieces = 0;
  std::vector<std::uint32_t> held;     ///< all held poses, given or chosen, ascending
  std::vector<std::uint32_t> anchors;  ///< first poses of pieces that know the vertical, ascending
  BlockStructure structure;

  /// Adds an edge without a new arrangement. True if this is possible: both ends are unknowns that another
  /// edge joins already.
  bool append(const BlockPair& ends);

  /// `ends`: (from, to) of each edge. One flag per pose: `given_held`, and whether it knows the vertical.
  void arrange(std::size_t poses, std::span<const BlockPair> ends, const std::vector<bool>& given_held,
               const std::vector<bool>& knows_vertical);
};

/// The piece of each pose, numbered in the order of their first poses.
std::vector<std::uint32_t> graphPieces(std::size_t poses, std::span<const BlockPair> ends,
                                       std::uint32_t& count);

}  // namespace swiftlet
