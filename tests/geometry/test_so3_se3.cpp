#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/geometry/random_vectors.hpp"
#include "tests/support/numeric_jacobian.hpp"

namespace swiftlet::test {
namespace {

constexpr double kPi = std::numbers::pi;

// Angles where the formulas switch or lose digits.
constexpr double kAngles[] = {0.0, 1e-300, 1e-12, 1e-8, 0.99e-4,    1.01e-4,    1e-3,       0.1,
                              1.0, 2.0,    3.0,   3.14, kPi - 1e-6, kPi - 1e-9, kPi - 1e-12};

// Exp by its series in extended precision.
Eigen::Matrix3d expBySeries(const Eigen::Vector3d& phi) {
  using Matrix3l = Eigen::Matrix<long double, 3, 3>;
  const Matrix3l A = hat(phi).cast<long double>();
  Matrix3l term = Matrix3l::Identity();
  Matrix3l sum = term;
  for (int i = 1; i < 40; ++i) {
    term = (term * A / static_cast<long double>(i)).eval();
    sum += term;
  }
  return sum.cast<double>();
}

}  // namespace

TEST_CASE("hat is the cross product", "[so3]") {
  Random random(1);
  const Eigen::Vector3d a = unitVector(random);
  const Eigen::Vector3d b = unitVector(random);
  CHECK((hat(a) * b - a.cross(b)).norm() < 1e-15);
}

TEST_CASE("Exp agrees with its series and gives unit quaternions", "[so3]") {
  Random random(2);
  for (const double angle : kAngles) {
    const Eigen::Vector3d phi = angle * unitVector(random);
    INFO("angle " << angle);
    CHECK((expSo3Matrix(phi) - expBySeries(phi)).cwiseAbs().maxCoeff() < 4e-15);
    CHECK(std::abs(expSo3(phi).norm() - 1.0) < 4e-16);
  }
}

TEST_CASE("Log undoes Exp, from zero to pi, for both signs of the quaternion", "[so3]") {
  Random random(3);
  for (const double angle : kAngles) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d phi = angle * unitVector(random);
      const Eigen::Quaterniond q = expSo3(phi);
      const Eigen::Quaterniond minus_q(-q.coeffs());
      INFO("angle " << angle);
      CHECK((logSo3(q) - phi).norm() <= 2e-15 * std::max(angle, 1e-300) + (angle > 3 ? 2e-15 : 0));
      CHECK((logSo3(minus_q) - logSo3(q)).norm() == 0.0);
      CHECK((logSo3(q.toRotationMatrix()) - phi).norm() < 5e-15);
    }
  }
}

TEST_CASE("Log at exactly pi gives a vector of length pi", "[so3]") {
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0),
                                      Eigen::Vector3d(0.6, 0, -0.8), Eigen::Vector3d(0.48, 0.6, 0.64)}) {
    const Eigen::Quaterniond q(0.0, axis.x(), axis.y(), axis.z());
    CHECK(std::abs(logSo3(q).norm() - kPi) < 1e-15);
    CHECK(std::abs(std::abs(logSo3(q).dot(axis)) - kPi) < 1e-15);
    CHECK(std::abs(std::abs(logSo3(q.toRotationMatrix()).dot(axis)) - kPi) < 1e-7);
  }
}

TEST_CASE("right Jacobian and its inverse agree with differences", "[so3]") {
  Random random(4);
  for (const double angle : {0.0, 1e-9, 0.99e-4, 1.01e-4, 1e-3, 0.1, 1.0, 2.0, 3.0, 3.14}) {
    const Eigen::Vector3d phi = angle * unitVector(random);
    const auto exp = [](const Eigen::Vector3d& x) { return expSo3(x); };
    const Eigen::Matrix3d numeric = numericJacobian<3, 3>(exp, phi);
    const Eigen::Quaterniond q = expSo3(phi);
    const auto log = [](const Eigen::Quaterniond& x) { return logSo3(x); };
    INFO("angle " << angle);
    CHECK(relativeDifference(rightJacobianSo3(phi), numeric) < 1e-9);
    if (angle < 3.1)
      CHECK(relativeDifference(rightJacobianInverseSo3(phi), numericJacobian<3, 3>(log, q)) < 1e-8);
    CHECK(relativeDifference(rightJacobianInverseSo3(phi) * rightJacobianSo3(phi),
                             Eigen::Matrix3d::Identity()) < 1e-12);
  }
}

TEST_CASE("the inverse right Jacobian holds beyond pi", "[so3]") {
  Random random(5);
  for (const double angle : {3.5, 5.0, 6.0}) {
    const Eigen::Vector3d phi = angle * unitVector(random);
    CHECK(relativeDifference(rightJacobianInverseSo3(phi) * rightJacobianSo3(phi),
                             Eigen::Matrix3d::Identity()) < 1e-11);
  }
}

TEST_CASE("poses compose, invert and move points", "[se3]") {
  Random random(6);
  for (int i = 0; i < 50; ++i) {
    const SE3 T_A_B(expSo3(3 * unitVector(random)), 5 * unitVector(random));
    const SE3 T_B_C(expSo3(2 * unitVector(random)), 5 * unitVector(random));
    const Eigen::Vector3d p = 10 * unitVector(random);
    CHECK((T_A_B * T_B_C * p - T_A_B * (T_B_C * p)).norm() < 1e-13);
    CHECK((T_A_B.inverse() * (T_A_B * p) - p).norm() < 1e-13);
    CHECK(boxMinus(T_A_B * T_A_B.inverse(), SE3()).norm() < 1e-14);
    CHECK((SE3(T_A_B.R(), T_A_B.translation) * p - T_A_B * p).norm() < 1e-13);
    const Eigen::Vector3d expected = T_A_B.R() * p + T_A_B.translation;
    CHECK((T_A_B * p - expected).norm() < 1e-13);
  }
}

TEST_CASE("a long chain of poses stays a pose", "[se3]") {
  Random random(7);
  SE3 T;
  for (int i = 0; i < 100000; ++i) T = T * SE3(expSo3(0.01 * unitVector(random)), Eigen::Vector3d::Zero());
  CHECK(std::abs(T.rotation.norm() - 1.0) < 1e-15);
}

}  // namespace swiftlet::test
