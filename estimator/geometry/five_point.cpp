#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "estimator/geometry/minimal_solvers.hpp"
#include "estimator/geometry/real_roots.hpp"

namespace swiftlet {
namespace {

// Polynomials in x, y, z of total degree 1, 2 and 3, as coefficient arrays.
// Degree 1: x y z 1.
using Linear = std::array<double, 4>;
// Degree 2: x2 xy y2 xz x yz y z2 z 1.
using Quadratic = std::array<double, 10>;
// Degree 3, in Nister's order: the first ten monomials are eliminated, the last ten are powers of z
// times x, y or 1.
// x3 y3 x2y xy2 x2z x2 y2z y2 xyz xy | xz2 xz x yz2 yz y z3 z2 z 1.
using Cubic = std::array<double, 20>;

// Index of the product of two degree-1 monomials among those of degree 2.
constexpr std::array<std::array<std::size_t, 4>, 4> kLinearTimesLinear = {
    {{0, 1, 3, 4}, {1, 2, 5, 6}, {3, 5, 7, 8}, {4, 6, 8, 9}}};
// Index of (degree-2 monomial) * (degree-1 monomial) among those of degree 3.
constexpr std::array<std::array<std::size_t, 4>, 10> kQuadraticTimesLinear = {{{0, 2, 4, 5},
                                                                               {2, 3, 8, 9},
                                                                               {3, 1, 6, 7},
                                                                               {4, 8, 10, 11},
                                                                               {5, 9, 11, 12},
                                                                               {8, 6, 13, 14},
                                                                               {9, 7, 14, 15},
                                                                               {10, 13, 16, 17},
                                                                               {11, 14, 17, 18},
                                                                               {12, 15, 18, 19}}};
constexpr std::size_t kEliminated = 10;
// With a pivot below this share of the row's scale, the five points do not determine the motion.
constexpr double kMinPivot = 1e-12;

void addProduct(const Linear& a, const Linear& b, double factor, Quadratic& sum) {
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) sum[kLinearTimesLinear[i][j]] += factor * a[i] * b[j];
  }
}

void addProduct(const Quadratic& a, const Linear& b, Cubic& sum) {
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t j = 0; j < 4; ++j) sum[kQuadraticTimesLinear[i][j]] += a[i] * b[j];
  }
}

using LinearMatrix = std::array<std::array<Linear, 3>, 3>;
using Constraints = std::array<Cubic, 10>;

// det(E) = 0.
Cubic determinantConstraint(const LinearMatrix& E) {
  Cubic sum{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const std::size_t k = (i + 2) % 3;
    Quadratic minor{};
    addProduct(E[1][j], E[2][k], 1.0, minor);
    addProduct(E[1][k], E[2][j], -1.0, minor);
    addProduct(minor, E[0][i], sum);
  }
  return sum;
}

// E E^T E - 1/2 trace(E E^T) E = 0, nine equations.
void traceConstraints(const LinearMatrix& E, Constraints& rows) {
  std::array<std::array<Quadratic, 3>, 3> M{};  // E E^T - 1/2 trace I
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = i; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) addProduct(E[i][k], E[j][k], 1.0, M[i][j]);
      M[j][i] = M[i][j];
    }
  }
  for (std::size_t m = 0; m < 10; ++m) {
    const double half_trace = 0.5 * (M[0][0][m] + M[1][1][m] + M[2][2][m]);
    for (std::size_t i = 0; i < 3; ++i) M[i][i][m] -= half_trace;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      Cubic& row = rows[1 + 3 * i + j];
      for (std::size_t k = 0; k < 3; ++k) addProduct(M[i][k], E[k][j], row);
    }
  }
}

// Gauss-Jordan with row pivoting: the first ten columns become the identity.
bool eliminate(Constraints& rows) {
  for (std::size_t column = 0; column < kEliminated; ++column) {
    std::size_t pivot = column;
    for (std::size_t i = column + 1; i < kEliminated; ++i) {
      if (std::abs(rows[i][column]) > std::abs(rows[pivot][column])) pivot = i;
    }
    if (!(std::abs(rows[pivot][column]) > kMinPivot)) return false;
    std::swap(rows[column], rows[pivot]);
    const double inverse = 1.0 / rows[column][column];
    for (std::size_t m = column; m < 20; ++m) rows[column][m] *= inverse;
    for (std::size_t i = 0; i < kEliminated; ++i) {
      // Rows 0 to 3 (x3 y3 x2y xy2) are not used below and need not be cleared.
      if (i == column || i < std::min<std::size_t>(column, 4)) continue;
      const double factor = rows[i][column];
      for (std::size_t m = column; m < 20; ++m) rows[i][m] -= factor * rows[column][m];
    }
  }
  return true;
}

// A row of B(z): x * p[0](z) + y * p[1](z) + p[2](z) = 0, from the constant term up.
using HiddenRow = std::array<std::array<double, 5>, 3>;

// (row with leading monomial m z) - z (row with leading monomial m).
HiddenRow hiddenRow(const Cubic& with_z, const Cubic& without_z) {
  HiddenRow p{};
  for (std::size_t block = 0; block < 2; ++block) {  // x, then y: z2 z 1
    const std::size_t at = 10 + 3 * block;
    p[block] = {with_z[at + 2], with_z[at + 1] - without_z[at + 2], with_z[at] - without_z[at + 1],
                -without_z[at], 0.0};
  }
  p[2] = {with_z[19], with_z[18] - without_z[19], with_z[17] - without_z[18], with_z[16] - without_z[17],
          -without_z[16]};
  return p;
}

Polynomial determinantOf(const std::array<HiddenRow, 3>& B) {
  Polynomial sum{};
  for (std::size_t r = 0; r < 3; ++r) {
    const HiddenRow& a = B[(r + 1) % 3];
    const HiddenRow& b = B[(r + 2) % 3];
    std::array<double, 7> minor{};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) minor[i + j] += a[0][i] * b[1][j] - a[1][i] * b[0][j];
    }
    for (std::size_t i = 0; i < 7; ++i) {
      for (std::size_t j = 0; j < 5; ++j) {
        if (i + j <= kMaxDegree) sum[i + j] += minor[i] * B[r][2][j];
      }
    }
  }
  return sum;
}

Eigen::Matrix3d evaluate(const std::array<HiddenRow, 3>& B, double z) {
  Eigen::Matrix3d value;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const std::array<double, 5>& p = B[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      value(i, j) = p[0] + z * (p[1] + z * (p[2] + z * (p[3] + z * p[4])));
    }
  }
  return value;
}

// The null vector of B(z): the longest cross product of two of its rows.
Eigen::Vector3d nullVector(const Eigen::Matrix3d& value) {
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d candidate = value.row(i).cross(value.row((i + 1) % 3)).transpose();
    if (candidate.squaredNorm() > best.squaredNorm()) best = candidate;
  }
  return best;
}

}  // namespace

FixedVector<Eigen::Matrix3d, kMaxEssentials> essentialFromFivePoints(
    std::span<const Eigen::Vector3d, 5> prev, std::span<const Eigen::Vector3d, 5> cur) {
  FixedVector<Eigen::Matrix3d, kMaxEssentials> essentials;
  Eigen::Matrix<double, 9, 5> A;  // column i: cur prev^T, row-major; orthogonal to E
  for (int i = 0; i < 5; ++i) {
    const auto at = static_cast<std::size_t>(i);
    for (int r = 0; r < 3; ++r) A.block<3, 1>(3 * r, i) = cur[at][r] * prev[at];
  }
  const Eigen::HouseholderQR<Eigen::Matrix<double, 9, 5>> qr(A);
  Eigen::Matrix<double, 9, 4> basis = Eigen::Matrix<double, 9, 4>::Zero();
  basis.bottomRows<4>().setIdentity();
  basis.applyOnTheLeft(qr.householderQ());

  LinearMatrix E;
  for (int i = 0; i < 9; ++i) {
    Linear& entry = E[static_cast<std::size_t>(i / 3)][static_cast<std::size_t>(i % 3)];
    for (int k = 0; k < 4; ++k) entry[static_cast<std::size_t>(k)] = basis(i, k);
  }
  Constraints rows{};
  rows[0] = determinantConstraint(E);
  traceConstraints(E, rows);
  if (!eliminate(rows)) return essentials;

  const std::array<HiddenRow, 3> B = {hiddenRow(rows[4], rows[5]), hiddenRow(rows[6], rows[7]),
                                      hiddenRow(rows[8], rows[9])};
  for (const double z : realRoots(determinantOf(B), kMaxDegree)) {
    const Eigen::Vector3d xy1 = nullVector(evaluate(B, z));
    const Eigen::Vector4d weights(xy1.x(), xy1.y(), z * xy1.z(), xy1.z());
    const Eigen::Matrix<double, 9, 1> flat = basis * weights;
    const double norm = flat.norm();
    if (!(norm > 0) || !std::isfinite(norm)) continue;
    Eigen::Matrix3d essential;
    for (int r = 0; r < 3; ++r) essential.row(r) = flat.segment<3>(3 * r).transpose();
    if (!essentials.tryPushBack(essential * (std::numbers::sqrt2 / norm))) break;
  }
  return essentials;
}

}  // namespace swiftlet
