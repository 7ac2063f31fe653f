#pragma once
// A small linearized factor over any variables, as input of the normal equations.
//
// Shapes: `jacobian` has up to kMaxRows rows and `columns` columns, whose columns in the system are in
// `column`; `residual` has as many rows. Both are whitened and multiplied by the root of the robust weight;
// unused rows are zero. `cost` is half the (robust) square. Memory: 1.3 kB, on the stack. Cost of adding it
// to a system: quadratic in its columns.

#include <Eigen/Core>
#include <array>
#include <cassert>

#include "estimator/messages/nav_state.hpp"
#include "estimator/smoother/prior.hpp"

namespace swiftlet {

struct LinearFactor {
  static constexpr int kMaxRows = 3;
  /// Enough for the calibration and two complete states.
  static constexpr int kMaxColumns = kMaxCalibrationDim + 2 * kStateDim;

  int columns = 0;
  std::array<int, kMaxColumns> column{};
  Eigen::Matrix<double, kMaxRows, kMaxColumns> jacobian;
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  double cost = 0;

  /// Appends a variable whose columns in the system start at `offset`. At most kMaxColumns in total.
  template <typename Derived>
  void addVariable(int offset, const Eigen::MatrixBase<Derived>& J) {
    assert(columns + J.cols() <= kMaxColumns);
    for (Eigen::Index c = 0; c < J.cols(); ++c) {
      jacobian.col(columns).setZero();
      jacobian.col(columns).head(J.rows()) = J.col(c);
      column[static_cast<std::size_t>(columns++)] = offset + static_cast<int>(c);
    }
  }
};

}  // namespace swiftlet
