#include "estimator/smoother/cholesky.hpp"

#include <cmath>

namespace swiftlet {
namespace {

constexpr Eigen::Index kPanel = 4;  // columns per update: enough to hide the load of the target

}  // namespace

bool choleskyInPlace(MatrixMap A) {
  const Eigen::Index n = A.rows();
  double* const a = A.data();
  const Eigen::Index stride = A.outerStride();
  for (Eigen::Index panel = 0; panel < n; panel += kPanel) {
    const Eigen::Index end = std::min(panel + kPanel, n);
    for (Eigen::Index j = panel; j < end; ++j) {
      double* const column = a + j * stride;
      // Columns of this panel that are already done.
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
    // Right-looking update of everything behind the panel, four columns of L at once.
    const double* const l0 = a + panel * stride;
    const double* const l1 = l0 + stride;
    const double* const l2 = l1 + stride;
    const double* const l3 = l2 + stride;
    for (Eigen::Index j = end; j < n; ++j) {
      double* const column = a + j * stride;
      const double f0 = l0[j];
      const double f1 = l1[j];
      const double f2 = l2[j];
      const double f3 = l3[j];
      if (f0 == 0 && f1 == 0 && f2 == 0 && f3 == 0) continue;
      for (Eigen::Index i = j; i < n; ++i) {
        column[i] -= f0 * l0[i] + f1 * l1[i] + f2 * l2[i] + f3 * l3[i];
      }
    }
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
