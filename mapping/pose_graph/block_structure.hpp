#pragma once
// Symbolic analysis of a symmetric block matrix: the pattern of its Cholesky factor and the position of each
// matrix block in it.
//
// A block is a pose. The analysis works on poses instead of scalars (36 times fewer entries in space), and
// one analysis serves factors of any block size: rotations (3), positions (3) and whole poses (6) of a graph.
// Steps: fill-reducing ordering (approximate minimum degree or nested dissection, whichever needs less work
// for the factor), elimination tree, postorder, fundamental supernodes, relaxation. Relaxation merges a child
// into its parent if the added zeros cost less than the saved front. Off the flight path: allocates in
// proportion to the blocks of the factor. Sources: Liu, "The role of elimination trees in sparse
// factorization", SIAM J. Matrix Anal. 1990; Ashcraft and Grimes, "The influence of relaxed supernode
// partitions on the multifrontal method", ACM TOMS 1989.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace swiftlet {

/// Row and column of an off-diagonal block.
using BlockPair = std::pair<std::uint32_t, std::uint32_t>;

/// A supernode: consecutive columns of the factor with the same rows below them.
struct FrontNode {
  static constexpr std::uint32_t kNoParent = 0xffffffffU;

  std::uint32_t first_column = 0;  ///< position of its first block in the order of elimination
  std::uint32_t columns = 0;       ///< blocks eliminated here
  std::uint32_t rows = 0;          ///< blocks below them
  std::uint32_t rows_begin = 0;    ///< in BlockStructure::rows() and parentRows()
  std::uint32_t parent = kNoParent;
  std::uint32_t children = 0;
  std::size_t panel_begin = 0;  ///< in blocks: (columns + rows) x columns are stored, column by column

  [[nodiscard]] std::uint32_t height() const { return columns + rows; }
};

/// Position of an off-diagonal block: `row` in the front of `node`, `column` of that node, in blocks.
struct BlockSlot {
  std::uint32_t node = 0;
  std::uint32_t row = 0;
  std::uint32_t column = 0;
  bool transposed = false;  ///< the slot holds block (second, first) instead of (first, second)
};

struct FrontDraft;

class BlockStructure {
 public:
  /// Analyzes a matrix of `blocks` diagonal blocks and one off-diagonal block per pair. Each pair is given
  /// once, in either order; first != second, both < blocks. Deterministic.
  void analyze(std::uint32_t blocks, std::span<const BlockPair> pairs);

  [[nodiscard]] std::uint32_t blocks() const { return static_cast<std::uint32_t>(place_.size()); }
  /// Postordered: children before parents.
  [[nodiscard]] std::span<const FrontNode> nodes() const { return nodes_; }
  /// Positions in the order of elimination below each node, ascending.
  [[nodiscard]] std::span<const std::uint32_t> rows() const { return rows_; }
  /// For each entry of rows(): its row in the parent's front.
  [[nodiscard]] std::span<const std::uint32_t> parentRows() const { return parent_rows_; }
  /// Position of a block in the order of elimination.
  [[nodiscard]] std::uint32_t place(std::uint32_t block) const { return place_[block]; }
  [[nodiscard]] std::span<const BlockSlot> slots() const { return slots_; }  ///< in the order of the pairs
  [[nodiscard]] std::uint32_t nodeOf(std::uint32_t block) const { return node_of_[place_[block]]; }

  [[nodiscard]] std::size_t panelBlocks() const { return panel_blocks_; }  ///< stored blocks of the factor
  [[nodiscard]] std::size_t stackBlocks() const {
    return stack_blocks_;
  }                                                    ///< largest number of update blocks at one time
  [[nodiscard]] double work() const { return work_; }  ///< block multiplications of a factorization

 private:
  void build(std::span<const std::uint32_t> order, std::span<const BlockPair> pairs);
  void number(std::span<const FrontDraft> drafts, std::span<const std::uint32_t> draft_rows);
  void placeSlots(std::span<const BlockPair> pairs);
  void measure();

  std::vector<FrontNode> nodes_;
  std::vector<std::uint32_t> rows_;
  std::vector<std::uint32_t> parent_rows_;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> node_of_;  ///< by position
  std::vector<BlockSlot> slots_;
  std::size_t panel_blocks_ = 0;
  std::size_t stack_blocks_ = 0;
  double work_ = 0;
};

}  // namespace swiftlet
