// The in-place factorization against Eigen's.

#include "estimator/smoother/cholesky.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <limits>

#include "estimator/core/random.hpp"

using namespace swiftlet;

namespace {

Eigen::MatrixXd randomMatrix(Eigen::Index rows, Eigen::Index columns, Random& random) {
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index k = 0; k < m.size(); ++k) m.data()[k] = random.normal();
  return m;
}

Eigen::MatrixXd randomSpd(Eigen::Index n, Random& random) {
  const Eigen::MatrixXd m = randomMatrix(n, n, random);
  return m * m.transpose() + 0.1 * static_cast<double>(n) * Eigen::MatrixXd::Identity(n, n);
}

// A as a window has it: states that share nothing leave blocks of zeros.
Eigen::MatrixXd bandedSpd(Eigen::Index n, Random& random) {
  Eigen::MatrixXd A = randomSpd(n, random);
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index c = 0; c < n; ++c) {
      if (std::abs(r / 6 - c / 6) > 1) A(r, c) = 0;
    }
    A(r, r) += 10.0 * static_cast<double>(n);
  }
  return A;
}

bool factor(const Eigen::MatrixXd& A, std::vector<double>& storage) {
  const auto n = static_cast<std::size_t>(A.rows());
  storage.assign(alignedMapSize(n), std::numeric_limits<double>::quiet_NaN());
  MatrixMap map = alignedMap(storage, A.rows());
  map.setConstant(std::numeric_limits<double>::quiet_NaN());  // the upper triangle must not be read
  map.triangularView<Eigen::Lower>() = A;
  return choleskyInPlace(map);
}

void checkAgainstEigen(const Eigen::MatrixXd& A, Random& random) {
  const Eigen::Index n = A.rows();
  std::vector<double> storage;
  REQUIRE(factor(A, storage));
  const MatrixMap L = alignedMap(storage, n);
  const Eigen::LLT<Eigen::MatrixXd> llt(A);
  REQUIRE(llt.info() == Eigen::Success);
  const Eigen::MatrixXd expected = llt.matrixL();
  const double scale = expected.cwiseAbs().maxCoeff();
  double worst = 0;
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = c; r < n; ++r) worst = std::max(worst, std::abs(L(r, c) - expected(r, c)));
  }
  CHECK(worst < 1e-12 * scale);

  const Eigen::VectorXd b = randomMatrix(n, 1, random);
  Eigen::VectorXd x = b;
  choleskySolve(L, VectorMap(x.data(), n));
  CHECK((A * x - b).norm() < 1e-11 * b.norm());

  // The forward half, also from the middle of a right side that begins with zeros.
  for (const Eigen::Index first : {Eigen::Index{0}, n / 2, n - 1}) {
    Eigen::VectorXd y = b;
    y.head(first).setZero();
    const Eigen::VectorXd y_expected = llt.matrixL().solve(y);
    choleskyForward(L, VectorMap(y.data(), n), first);
    CHECK((y - y_expected).norm() < 1e-11 * (1.0 + y_expected.norm()));
  }
}

}  // namespace

TEST_CASE("Cholesky agrees with Eigen's at every remainder of the panel width", "[smoother][cholesky]") {
  Random random(1);
  for (Eigen::Index n = 1; n <= 40; ++n) {
    INFO("n = " << n);
    checkAgainstEigen(randomSpd(n, random), random);
  }
  for (const Eigen::Index n : {63, 64, 65, 127, 198, 213}) {
    INFO("n = " << n);
    checkAgainstEigen(randomSpd(n, random), random);
    checkAgainstEigen(bandedSpd(n, random), random);
  }
}

TEST_CASE("Cholesky refuses what is not positive definite", "[smoother][cholesky]") {
  Random random(2);
  std::vector<double> storage;
  for (const Eigen::Index n : {1, 2, 5, 16, 31}) {
    INFO("n = " << n);
    for (Eigen::Index bad = 0; bad < n; ++bad) {
      Eigen::MatrixXd A = randomSpd(n, random);
      A(bad, bad) = -A(bad, bad);
      CHECK_FALSE(factor(A, storage));
      A(bad, bad) = std::numeric_limits<double>::quiet_NaN();
      CHECK_FALSE(factor(A, storage));
      A(bad, bad) = std::numeric_limits<double>::infinity();
      CHECK_FALSE(factor(A, storage));
    }
    CHECK_FALSE(factor(Eigen::MatrixXd::Zero(n, n), storage));
    // Indefinite with a positive diagonal.
    if (n < 2) continue;
    Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n);
    A(n - 1, 0) = A(0, n - 1) = 1.5;
    CHECK_FALSE(factor(A, storage));
  }
}

TEST_CASE("The aligned map starts its columns on 32-byte borders within its storage",
          "[smoother][cholesky]") {
  for (std::size_t n = 1; n < 70; ++n) {
    std::vector<double> storage(alignedMapSize(n));
    const MatrixMap map = alignedMap(storage, static_cast<Eigen::Index>(n));
    for (Eigen::Index c = 0; c < map.cols(); ++c) {
      CHECK(reinterpret_cast<std::uintptr_t>(map.col(c).data()) % 32 == 0);
    }
    const double* const last = &map.coeffRef(map.rows() - 1, map.cols() - 1);
    CHECK(last < storage.data() + storage.size());
  }
}
