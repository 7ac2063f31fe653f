// Errors of relative poses: exact Jacobians, g2o's numbers, and where angles turn over.

#include <catch2/catch.hpp>

#include "estimator/core/random.hpp"
#include "mapping/pose_graph/pose_error.hpp"
#include "tests/mapping/random_graph.hpp"
#include "tests/support/numeric_jacobian.hpp"

namespace swiftlet::test {
namespace {

template <typename Pose>
void checkJacobians(std::uint64_t seed) {
  constexpr int kDof = PoseSpace<Pose>::kDof;
  Random random(seed);
  for (int round = 0; round < 200; ++round) {
    const Pose from = randomPose<Pose>(random, 2.0);
    const Pose to = randomPose<Pose>(random, 2.0);
    // Near and far from the measurement, but away from half a turn, where the error jumps.
    const Pose measured = from.inverse() * to * randomPose<Pose>(random, round % 2 == 0 ? 1e-3 : 0.7);
    const EdgeLinearization<Pose> lin = linearized(measured, from, to);
    CHECK((lin.error - relativeError(measured, from, to)).norm() < 1e-12);
    const auto plus = [](const Pose& pose, const PoseTangent<Pose>& step) { return retracted(pose, step); };
    const auto minus = [](const auto& a, const auto& b) { return PoseTangent<Pose>(a - b); };
    const auto by_to = numericJacobian<kDof, kDof>(
        [&](const Pose& x) { return relativeError(measured, from, x); }, to, plus, minus);
    const auto by_from = numericJacobian<kDof, kDof>(
        [&](const Pose& x) { return relativeError(measured, x, to); }, from, plus, minus);
    CHECK(relativeDifference(lin.jacobian_to, by_to) < 1e-8);
    CHECK(relativeDifference((-lin.jacobian_to * lin.adjoint).eval(), by_from) < 1e-8);
  }
}

TEST_CASE("Jacobians of relative poses agree with differences") {
  SECTION("plane") { checkJacobians<SE2>(1); }
  SECTION("space") { checkJacobians<SE3>(2); }
}

TEST_CASE("the error is g2o's: worked by hand") {
  // Rotations about z by 0.5 from a measured 0.3: vec(q) of 0.2, doubled.
  const SE3 from(Eigen::Quaterniond(Eigen::AngleAxisd(0.25, Eigen::Vector3d::UnitZ())),
                 Eigen::Vector3d(1, 2, 3));
  const SE3 to = from * SE3(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())), {1, 0, 0});
  const SE3 measured(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {0, 0, 0});
  const PoseTangent<SE3> e = relativeError(measured, from, to);
  CHECK(e[2] == Approx(2 * std::sin(0.1)));
  // One metre along x of `from`, as seen from the measured frame of `to`, which is turned by 0.3.
  CHECK(e[3] == Approx(std::cos(0.3)));
  CHECK(e[4] == Approx(-std::sin(0.3)));
  CHECK(std::abs(e[0]) + std::abs(e[1]) + std::abs(e[5]) < 1e-15);

  const SE2 flat = SE2(3.0, {0, 0});
  const PoseTangent<SE2> wrapped = relativeError(SE2(0.3, {0, 0}), flat, flat * SE2(0.5, {1, 0}));
  CHECK(wrapped[0] == Approx(0.2));
  CHECK(wrapped[1] == Approx(std::cos(0.3)));
  CHECK(wrapped[2] == Approx(-std::sin(0.3)));
}

TEST_CASE("a quaternion and its negative have one error") {
  Random random(3);
  for (int k = 0; k < 50; ++k) {
    const SE3 from = randomPose<SE3>(random, 2);
    SE3 to = randomPose<SE3>(random, 2);
    const SE3 measured = randomPose<SE3>(random, 2);
    const PoseTangent<SE3> e = relativeError(measured, from, to);
    const EdgeLinearization<SE3> lin = linearized(measured, from, to);
    to.rotation.coeffs() *= -1;
    CHECK((relativeError(measured, from, to) - e).norm() < 1e-14);
    CHECK((linearized(measured, from, to).jacobian_to - lin.jacobian_to).norm() < 1e-14);
  }
}

}  // namespace
}  // namespace swiftlet::test
