#pragma once
// Symbolic analysis of a symmetric block matrix: what a Cholesky factor of it looks like, and where each
// block of the matrix goes in it.
//
// A block is a pose; the analysis is done on poses, not on scalars (36 times fewer entries in space), and one
// analysis serves factors of any block size: rotations (3), positions (3) and whole poses (6) of one graph.
// Steps: fill-reducing ordering (the better of approximate minimum degree and nested dissection, by the work
// that the factor will take), elimination tree, postorder, fundamental supernodes, and their relaxation: a
// child is merged into its parent where the zeros that this adds cost less than the smaller number of fronts
// saves. Off the flight path: it allocates, in proportion to the blocks of the factor. Sources: Liu, "The
// role of elimination trees in sparse factorization", SIAM J. Matrix Anal. 1990; Ashcraft and Grimes, "The
// influence of relaxed supernode partitions on the multifrontal method", ACM TOMS 1989.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace swiftlet {

/// Two different blocks that an off-diagonal block of the matrix joins.
using BlockPair = std::pair<std::uint32_t, std::uint32_t>;

/// A supernode: consecutive columns of the factor with the same rows below them.
struct FrontNode {
  static constexpr std::uint32_t kNoParent = 0xffffffffU;

  std::uint32_t first_column = 0;  ///< place of its first block in the order of elimination
  std::uint32_t columns = 0;       ///< blocks eliminated here
  std::uint32_t rows = 0;          ///< blocks below them
  std::uint32_t rows_begin = 0;    ///< in BlockStructure::rows() and parentRows()
  std::uint32_t parent = kNoParent;
  std::uint32_t children = 0;
  std::size_t panel_begin = 0;  ///< in blocks: (columns + rows) x columns are stored, column by column

  [[nodiscard]] std::uint32_t height() const { return columns + rows; }
};

/// Where an off-diagonal block lies: `row` (of the front of `node`) and `column` (of that node), in blocks.
struct BlockSlot {
  std::uint32_t node = 0;
  std::uint32_t row = 0;
  std::uint32_t column = 0;
  bool transposed = false;  ///< the slot holds block (second, first); else (first, second)
};

struct FrontDraft;

class BlockStructure {
 public:
  /// Analyzes a matrix of `blocks` diagonal blocks and one off-diagonal block per pair (each pair once,
  /// either way around; first != second < blocks). Deterministic.
  void analyze(std::uint32_t blocks, std::span<const BlockPair> pairs);

  [[nodiscard]] std::uint32_t blocks() const { return static_cast<std::uint32_t>(place_.size()); }
  /// Postordered: children before parents.
  [[nodiscard]] std::span<const FrontNode> nodes() const { return nodes_; }
  /// Places in the order of elimination below each node, rising.
  [[nodiscard]] std::span<const std::uint32_t> rows() const { return rows_; }
  /// For each of rows(): its row in the parent's front.
  [[nodiscard]] std::span<const std::uint32_t> parentRows() const { return parent_rows_; }
  /// Place of a block in the order of elimination.
  [[nodiscard]] std::uint32_t place(std::uint32_t block) const { return place_[block]; }
  [[nodiscard]] std::span<const BlockSlot> slots() const { return slots_; }  ///< of the pairs, as given
  [[nodiscard]] std::uint32_t nodeOf(std::uint32_t block) const { return node_of_[place_[block]]; }

  [[nodiscard]] std::size_t panelBlocks() const { return panel_blocks_; }  ///< blocks stored of the factor
  [[nodiscard]] std::size_t stackBlocks() const {
    return stack_blocks_;
  }                                                    ///< blocks of update matrices at once
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
  std::vector<std::uint32_t> node_of_;  ///< by place
  std::vector<BlockSlot> slots_;
  std::size_t panel_blocks_ = 0;
  std::size_t stack_blocks_ = 0;
  double work_ = 0;
};

}  // namespace swiftlet
