#pragma once
// Cholesky factorization of a sparse symmetric positive definite matrix of small square blocks.
//
// Multifrontal: each supernode gathers its columns of the matrix and its children's update matrices in a
// dense front, eliminates its columns there and hands what remains to its parent. The fronts' arithmetic is
// dense, and wide ones run at the speed of matrix products; CHOLMOD's speed hangs on the BLAS that is
// installed, this one's does not (docs/pose_graph.md has both measured). The analysis (BlockStructure) is
// shared by factors of any block size. Numeric memory is reserved by prepare() and used again by each
// factor(). Source: Duff and Reid, "The multifrontal solution of indefinite sparse symmetric linear
// equations", ACM TOMS 1983; Liu, "The multifrontal method for sparse matrix solution", SIAM Review 1992.

#include <Eigen/Core>
#include <vector>

#include "mapping/pose_graph/block_structure.hpp"

namespace swiftlet {

/// The matrix: diagonal blocks (lower triangles are read) and the blocks of the structure's pairs.
template <int kBlock>
struct BlockMatrix {
  using Block = Eigen::Matrix<double, kBlock, kBlock>;
  std::vector<Block, Eigen::aligned_allocator<Block>> diagonal;
  std::vector<Block, Eigen::aligned_allocator<Block>> pairs;  ///< (first, second) of each pair

  /// Zero, of the given size.
  void reset(std::size_t blocks, std::size_t pair_count) {
    diagonal.assign(blocks, Block::Zero());
    pairs.assign(pair_count, Block::Zero());
  }
};

template <int kBlock>
class BlockCholesky {
 public:
  /// Reserves so many numbers for factors to come.
  void reserve(std::size_t values) { memory_.reserve(values); }
  /// Takes the memory that factors of this structure need. The structure must outlive this.
  void prepare(const BlockStructure& structure);

  /// Numbers of the factor and its workspace, as prepare() would take: a limit is checked before.
  [[nodiscard]] static std::size_t values(const BlockStructure& structure);

  /// Factors `matrix` + diag(damping). `damping` is empty or one number per scalar. False when the sum is not
  /// positive definite (to rounding).
  bool factor(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping);

  /// x <- matrix^-1 x, columns by column; blocks in the order of the structure's numbers.
  void solve(Eigen::Ref<Eigen::MatrixXd> x);

 private:
  void gather(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping);
  bool eliminate(double* panel, Eigen::Index height, Eigen::Index columns, double* update);
  void addChild(const FrontNode& child, const FrontNode& node, const double* update, double* panel,
                double* own_update) const;

  const BlockStructure* structure_ = nullptr;
  std::vector<double> memory_;  ///< the factor's panels, then the stack of update matrices
  std::size_t panel_values_ = 0;
  Eigen::MatrixXd ordered_;             ///< right-hand sides in the order of elimination
  Eigen::MatrixXd below_;               ///< of one node
  std::vector<std::uint32_t> waiting_;  ///< nodes whose updates lie on the stack
};

}  // namespace swiftlet
