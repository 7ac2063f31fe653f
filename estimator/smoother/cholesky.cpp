#include "estimator/smoother/cholesky.hpp"

#include <cmath>

namespace swiftlet {
namespace {

constexpr Eigen::Index kPanel = 4;  // columns per update: enough to hide the load of the target

// Subtracts the contribution of four finished columns of L, l0 the first, from columns [first, n) of A
// (right-looking). Two columns at once, so that each load of L is used twice.
void updateBehind(const double* __restrict l0, Eigen::Index stride, Eigen::Index first, Eigen::Index n,
                  double* a) {
  const double* __restrict const l1 = l0 + stride;
  const double* __restrict const l2 = l1 + stride;
  const double* __restrict const l3 = l2 + stride;
  const auto product = [&](Eigen::Index i, Eigen::Index k) {
    return l0[i] * l0[k] + l1[i] * l1[k] + l2[i] * l2[k] + l3[i] * l3[k];
  };
  for (Eigen::Index j = first; j < n; j += 2) {
    double* __restrict const left = a + j * stride;
    left[j] -= product(j, j);
    if (j + 1 == n) break;
    double* __restrict const right = left + stride;
    const double f0 = l0[j], f1 = l1[j], f2 = l2[j], f3 = l3[j];
    const double h0 = l0[j + 1], h1 = l1[j + 1], h2 = l2[j + 1], h3 = l3[j + 1];
    if (f0 == 0 && f1 == 0 && f2 == 0 && f3 == 0 && h0 == 0 && h1 == 0 && h2 == 0 && h3 == 0) continue;
    for (Eigen::Index i = j + 1; i < n; ++i) {
      left[i] -= f0 * l0[i] + f1 * l1[i] + f2 * l2[i] + f3 * l3[i];
      right[i] -= h0 * l0[i] + h1 * l1[i] + h2 * l2[i] + h3 * l3[i];
    }
  }
}

}  // namespace

bool choleskyInPlace(MatrixMap A) {
  const Eigen::Index n = A.rows();
  double* const a = A.data();
  const Eigen::Index stride = A.outerStride();
  for (Eigen::Index panel = 0; panel < n; panel += kPanel) {
    const Eigen::Index end = std::min(panel + kPanel, n);
    for (Eigen::Index j = panel; j < end; ++j) {
      double* const column = a + j * stride;
      // Columns of this panel that are finished.
      for (Eigen::Index k = panel; k < j; ++k) {
        const double* const done = a + k * stride;
        const double factor = done[j];
        for (Eigen::Index i = j; i < n; ++i) column[i] -= factor * done[i];
      }
      const double pivot = column[j];
      if (!(pivot > 0) || !std::isfinite(pivot)) return false;
      const double scale = 1.0 / std::sqrt(pivot);
      for (Eigen::Index i = j; i < n; ++i) column[i] *= scale;
    }
    if (end - panel < kPanel) break;
    updateBehind(a + panel * stride, stride, end, n, a);
  }
  return true;
}

void choleskyForward(const MatrixMap& L, VectorMap b, Eigen::Index first) {
  const Eigen::Index n = L.rows();
  for (Eigen::Index j = first; j < n; ++j) {
    const double* const column = L.data() + j * L.outerStride();
    b[j] /= column[j];
    const double value = b[j];
    for (Eigen::Index i = j + 1; i < n; ++i) b[i] -= value * column[i];
  }
}

void choleskySolve(const MatrixMap& L, VectorMap b) {
  choleskyForward(L, b);
  for (Eigen::Index j = L.rows() - 1; j >= 0; --j) {
    const double* const column = L.data() + j * L.outerStride();
    double sum = b[j];
    for (Eigen::Index i = j + 1; i < L.rows(); ++i) sum -= column[i] * b[i];
    b[j] = sum / column[j];
  }
}

}  // namespace swiftlet
