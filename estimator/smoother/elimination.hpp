#pragma once
// Eliminates columns from a quadratic cost by the Schur complement, to turn states into a prior.
//
// Shapes: H is n x n with both triangles filled, g is n x 1. At most 15 columns leave. They are inverted by
// eigenvalues; eigenvalues below 1e-12 of the largest (or of 1) carry no information. Memory: none of its
// own. Cost: quadratic in the remaining columns.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimator/smoother/cholesky.hpp"

namespace swiftlet {

struct ColumnRange {
  int offset = 0;
  int count = 0;  ///< at most kStateDim
};

/// Replaces H and g of the columns `others` by those of the cost minimized over `leaving`. The columns of
/// `leaving` are undefined afterwards. `work` has at least n x kStateDim doubles.
void eliminateColumns(MatrixMap H, VectorMap g, ColumnRange leaving, std::span<const ColumnRange> others,
                      std::vector<double>& work);

}  // namespace swiftlet
