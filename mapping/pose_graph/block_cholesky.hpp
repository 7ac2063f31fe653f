#pragma once
// Cholesky factorization of a sparse symmetric positive definite matrix of small square blocks.
//
// Multifrontal: each supernode gathers its columns of the matrix and the update matrices of its children in a
// dense front, eliminates its columns there and passes the remainder to its parent. Wide fronts run at the
// speed of dense matrix products and, unlike CHOLMOD, do not depend on the installed BLAS
// (docs/experiments/pose_graph.md compares both). The analysis (BlockStructure) serves factors of any block
// size. prepare() reserves numeric memory, which each factor() reuses. Sources: Duff and Reid, "The
// multifrontal solution of indefinite sparse symmetric linear equations", ACM TOMS 1983; Liu, "The
// multifrontal method for sparse matrix solution", SIAM Review 1992.

#include <Eigen/Core>
#include <vector>

#include "mapping/pose_graph/block_structure.hpp"

namespace swiftlet {

/// Diagonal blocks (only lower triangles are read) and the blocks of the structure's pairs.
template <int kBlock>
struct BlockMatrix {
  using Block = Eigen::Matrix<double, kBlock, kBlock>;
  std::vector<Block, Eigen::aligned_allocator<Block>> diagonal;
  std::vector<Block, Eigen::aligned_allocator<Block>> pairs;  ///< (first, second) of each pair

  /// Resizes and sets to zero.
  void reset(std::size_t blocks, std::size_t pair_count) {
    diagonal.assign(blocks, Block::Zero());
    pairs.assign(pair_count, Block::Zero());
  }
};

template <int kBlock>
class BlockCholesky {
 public:
  /// Reserves memory for factors of up to `values` doubles.
  void reserve(std::size_t values) { memory_.reserve(values); }
  /// Allocates the memory that factors of this structure need. The structure must outlive this object.
  void prepare(const BlockStructure& structure);

  /// Doubles that prepare() would allocate, so that a limit can be checked first.
  [[nodiscard]] static std::size_t values(const BlockStructure& structure);

  /// Factors `matrix` + diag(damping). `damping` is empty or has one number per scalar. False if the sum is
  /// not positive definite (to rounding).
  bool factor(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping);

  /// x <- matrix^-1 x for each column; blocks in the order of the structure's numbers.
  void solve(Eigen::Ref<Eigen::MatrixXd> x);

 private:
  void gather(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping);
  bool eliminate(double* panel, Eigen::Index height, Eigen::Index columns, double* update);
  void addChild(const FrontNode& child, const FrontNode& node, const double* update, double* panel,
                double* own_update) const;

  const BlockStructure* structure_ = nullptr;
  std::vector<double> memory_;  ///< panels of the factor, then the stack of update matrices
  std::size_t panel_values_ = 0;
  Eigen::MatrixXd ordered_;             ///< right-hand sides in the order of elimination
  Eigen::MatrixXd below_;               ///< rows below the columns of one node
  std::vector<std::uint32_t> waiting_;  ///< nodes whose update matrices are on the stack
};

}  // namespace swiftlet
