#pragma once
// Columns leave a quadratic cost by the Schur complement: how states become a prior.
//
// Shapes: H is n x n with both triangles filled, g is n x 1. What leaves is at most 15 columns, inverted by
// eigenvalues: those below 1e-12 of the largest (or of 1) are not information.
// Memory: none of its own. Cost: quadratic in the columns that stay.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimator/smoother/cholesky.hpp"

namespace swiftlet {

struct ColumnRange {
  int offset = 0;
  int count = 0;  ///< at most kStateDim
};

/// H and g of the columns of `others` become those of the cost with `leaving` minimized out. The columns of
/// `leaving` lose their meaning. `work` has at least n x kStateDim doubles.
void eliminateColumns(MatrixMap H, VectorMap g, ColumnRange leaving, std::span<const ColumnRange> others,
                      std::vector<double>& work);

}  // namespace swiftlet
