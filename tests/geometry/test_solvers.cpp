#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "estimator/geometry/minimal_solvers.hpp"
#include "estimator/geometry/real_roots.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/geometry/random_vectors.hpp"

namespace swiftlet::test {
namespace {

struct Pairs {
  Eigen::Matrix3d R;
  Eigen::Vector3d t;  // unit
  std::array<Eigen::Vector3d, 5> prev, cur;
};

// Points all around (bearings of any angle), 2 to 10 translations away.
Pairs randomPairs(Random& random, bool planar = false) {
  Pairs pairs;
  pairs.R = expSo3Matrix(random.uniform(0, 0.5) * unitVector(random));
  pairs.t = unitVector(random);
  for (std::size_t i = 0; i < 5; ++i) {
    Eigen::Vector3d p = random.uniform(2, 10) * unitVector(random);
    if (planar) p = {random.uniform(-4, 4), random.uniform(-4, 4), 5};
    pairs.prev[i] = p.normalized();
    pairs.cur[i] = (pairs.R * p + pairs.t).normalized();
  }
  return pairs;
}

double nearest(const FixedVector<Eigen::Matrix3d, kMaxEssentials>& essentials, const Eigen::Matrix3d& truth) {
  double best = 10;
  for (const Eigen::Matrix3d& E : essentials) best = std::min({best, (E - truth).norm(), (E + truth).norm()});
  return best;
}

}  // namespace

TEST_CASE("real roots of polynomials with known roots", "[solvers]") {
  Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    // Eight real roots, some far beyond 1, some near 0, and one complex pair.
    std::array<double, 8> truth{};
    for (double& root : truth) {
      root = std::exp(random.uniform(-3, 3)) * (random.uniform() < 0.5 ? -1.0 : 1.0);
    }
    Polynomial c{};
    c[0] = random.uniform(0.1, 4);  // x^2 + positive
    c[2] = 1;
    std::size_t degree = 2;
    for (const double root : truth) {
      ++degree;
      for (std::size_t i = degree; i > 0; --i) c[i] = c[i - 1] - root * c[i];
      c[0] *= -root;
    }
    const auto roots = realRoots(c, degree);
    REQUIRE(roots.size() <= 8);
    std::sort(truth.begin(), truth.end());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double gap =
          std::min(i > 0 ? truth[i] - truth[i - 1] : 1e9, i < 7 ? truth[i + 1] - truth[i] : 1e9);
      if (gap < 0.05 * std::abs(truth[i])) continue;  // ill-conditioned
      double best = 1e9;
      for (const double root : roots) best = std::min(best, std::abs(root - truth[i]));
      CHECK(best < 1e-6 * std::abs(truth[i]));
    }
  }
}

TEST_CASE("real roots: none, at zero, and of lower degree", "[solvers]") {
  CHECK(realRoots({1, 0, 1}, 2).empty());
  CHECK(realRoots({5}, 0).empty());
  const auto line = realRoots({-3, 2}, 1);
  REQUIRE(line.size() == 1);
  CHECK(line[0] == Approx(1.5));
  const auto with_zero = realRoots({0, -4, 0, 1}, 3);  // 0, 2, -2
  CHECK(with_zero.size() == 3);
}

TEST_CASE("five points: every solution fits, one is the truth", "[solvers]") {
  Random random(2);
  int found = 0;
  constexpr int kTrials = 1000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pairs pairs = randomPairs(random);
    const auto essentials = essentialFromFivePoints(pairs.prev, pairs.cur);
    if (nearest(essentials, hat(pairs.t) * pairs.R) < 1e-6) ++found;
    for (const Eigen::Matrix3d& E : essentials) {
      CHECK(E.norm() == Approx(std::numbers::sqrt2));
      for (std::size_t i = 0; i < 5; ++i) CHECK(std::abs(pairs.cur[i].dot(E * pairs.prev[i])) < 1e-10);
    }
  }
  INFO("truth among the solutions: " << found << " of " << kTrials);
  CHECK(found >= 990);  // the rest: nearly double roots
}

TEST_CASE("five points on a plane", "[solvers]") {
  Random random(3);
  int found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Pairs pairs = randomPairs(random, true);
    if (nearest(essentialFromFivePoints(pairs.prev, pairs.cur), hat(pairs.t) * pairs.R) < 1e-5) ++found;
  }
  CHECK(found >= 190);
}

TEST_CASE("five times the same point gives no NaN", "[solvers]") {
  Random random(4);
  Pairs pairs = randomPairs(random);
  pairs.prev.fill(pairs.prev[0]);
  pairs.cur.fill(pairs.cur[0]);
  for (const Eigen::Matrix3d& E : essentialFromFivePoints(pairs.prev, pairs.cur)) CHECK(E.allFinite());
}

TEST_CASE("an essential matrix gives back its motion", "[solvers]") {
  Random random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const Pairs pairs = randomPairs(random);
    const EssentialMotions motions = motionsOfEssential(hat(pairs.t) * pairs.R);
    CHECK(std::abs(std::abs(motions.t.dot(pairs.t)) - 1) < 1e-12);
    double best = 10;
    for (const Eigen::Matrix3d& R : motions.R) {
      best = std::min(best, (R - pairs.R).norm());
      CHECK(R.determinant() == Approx(1.0));
      const Eigen::Matrix3d E = hat(motions.t) * R;
      CHECK(std::min((E - hat(pairs.t) * pairs.R).norm(), (E + hat(pairs.t) * pairs.R).norm()) < 1e-12);
    }
    CHECK(best < 1e-12);
  }
}

TEST_CASE("two points and the rotation give the direction of translation", "[solvers]") {
  Random random(6);
  for (int trial = 0; trial < 500; ++trial) {
    const Pairs pairs = randomPairs(random);
    const std::array from = {pairs.prev[0], pairs.prev[1]};
    const std::array to = {pairs.cur[0], pairs.cur[1]};
    CHECK((translationFromTwoPoints(pairs.R, from, to) - pairs.t).norm() < 1e-8);
  }
  const std::array still = {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.6, 0, 0.8)};
  CHECK(translationFromTwoPoints(Eigen::Matrix3d::Identity(), still, still).isZero(0));
}

TEST_CASE("two bearings give the rotation", "[solvers]") {
  Random random(7);
  for (int trial = 0; trial < 100; ++trial) {
    const Pairs pairs = randomPairs(random);
    const std::array from = {pairs.prev[0], pairs.prev[1]};
    const std::array to = {Eigen::Vector3d(pairs.R * pairs.prev[0]),
                           Eigen::Vector3d(pairs.R * pairs.prev[1])};
    CHECK((rotationFromTwoPoints(from, to) - pairs.R).norm() < 1e-10);
  }
}

}  // namespace swiftlet::test
