#pragma once
// The cost of a BenchmarkWindow handed to Ceres, with everything that makes Ceres fast on it:
// analytic Jacobians of fixed size from the smoother's own factor functions; cameras placed once an
// evaluation, not once a residual (evaluation callback); landmarks as 3-dof blocks without a manifold
// (tangent coordinates of the bearing, inverse depth), eliminated first by its Schur solvers, for whose
// 2 x 3 x 6 blocks Ceres carries specialized code; one thread; no convergence tests between iterations.
// States are two blocks, pose (quaternion and position on a manifold) and velocity with biases.

#include <ceres/problem.h>
#include <ceres/solver.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/benchmark/smoother_window.hpp"

namespace swiftlet::test {

struct CeresSolver {
  std::string name;
  ceres::LinearSolverType linear = ceres::DENSE_SCHUR;
  ceres::DenseLinearAlgebraLibraryType dense = ceres::EIGEN;
  ceres::SparseLinearAlgebraLibraryType sparse = ceres::SUITE_SPARSE;
};

class CeresWindow {
 public:
  /// Builds the problem at the window's present values. The window must outlive this.
  explicit CeresWindow(const BenchmarkWindow& window);
  ~CeresWindow();

  /// Back to the values of the construction.
  void reset();
  /// `iterations` Gauss-Newton steps.
  ceres::Solver::Summary solve(const CeresSolver& solver, int iterations);
  [[nodiscard]] WindowValues values() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace swiftlet::test
