#pragma once
// Dense Cholesky factorization in place, for the reduced system of the smoother.
//
// Column-major, lower triangle. Columns are updated four at a time, so that the inner loop is a contiguous
// fused multiply-add that the compiler vectorizes. Unlike Eigen's blocked LLT it does not allocate packing
// space. Cost: n^3 / 6 multiply-adds (about 0.1 ms at n = 170). No memory.

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

namespace swiftlet {

using MatrixMap = Eigen::Map<Eigen::MatrixXd, Eigen::Aligned32, Eigen::OuterStride<>>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;

/// Doubles that `alignedMap` needs for an n x n matrix.
constexpr std::size_t alignedMapSize(std::size_t n) { return n * ((n + 3) / 4 * 4) + 4; }

/// An n x n matrix in storage reserved by `alignedMapSize`; columns start on 32-byte boundaries.
inline MatrixMap alignedMap(std::vector<double>& storage, Eigen::Index n) {
  const Eigen::Index stride = (n + 3) / 4 * 4;
  void* start = storage.data();
  std::size_t space = storage.size() * sizeof(double);
  std::align(32, static_cast<std::size_t>(n * stride) * sizeof(double), start, space);
  return {static_cast<double*>(start), n, n, Eigen::OuterStride<>(stride)};
}

/// A = L L^T; L overwrites the lower triangle, the upper is not read. False if a pivot is not positive or not
/// finite: A is not positive definite, and its lower triangle is then undefined.
[[nodiscard]] bool choleskyInPlace(MatrixMap A);

/// Solves L L^T x = b in place; b has as many rows as L.
void choleskySolve(const MatrixMap& L, VectorMap b);

/// Solves L y = b in place (forward substitution) from row `first` on; b is zero above it.
void choleskyForward(const MatrixMap& L, VectorMap b, Eigen::Index first = 0);

}  // namespace swiftlet
