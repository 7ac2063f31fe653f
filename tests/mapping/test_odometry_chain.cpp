#include "mapping/pose_graph/odometry_chain.hpp"

#include <catch2/catch.hpp>

#include "tests/mapping/simulated_chain.hpp"

namespace swiftlet {
namespace {

TEMPLATE_TEST_CASE("Tangents of poses: exponential, logarithm and adjoint belong together", "[pose_graph]",
                   SE2, SE3) {
  Random random(3);
  const PoseMatrix<TestType> spread = testCovariance<TestType>(0.8, 5);
  for (int k = 0; k < 200; ++k) {
    const PoseVector<TestType> xi = normalVector<TestType>(spread, random);
    if (xi.template head<PoseSpace<TestType>::kRotationDof>().norm() > 3) {
      continue;  // beyond half a turn the logarithm is another
    }
    const TestType T = poseExp(xi);
    CHECK((poseLog(T) - xi).norm() < 1e-9);
    const TestType other = poseExp(normalVector<TestType>(spread, random));
    const PoseVector<TestType> small = 1e-6 * normalVector<TestType>(spread, random);
    const PoseVector<TestType> moved = poseLog(other * poseExp(small) * other.inverse());
    CHECK((moved - poseAdjoint(other) * small).norm() < 1e-9);
  }
}

/// Covariance of i -> j by compounding step after step, in the frame of the newest.
template <typename Pose>
PoseMatrix<Pose> compounded(const OdometryChain<Pose>& chain, const PoseMatrix<Pose>& step, std::uint32_t i,
                            std::uint32_t j) {
  PoseMatrix<Pose> sum = PoseMatrix<Pose>::Zero();
  for (std::uint32_t k = i + 1; k <= j; ++k) {
    const PoseMatrix<Pose> back = poseAdjoint((chain.pose(k - 1).inverse() * chain.pose(k)).inverse());
    sum = (back * sum * back.transpose() + step).eval();
  }
  return sum;
}

TEMPLATE_TEST_CASE("Differences of cumulated covariances equal compounding, also at the end of a long chain",
                   "[pose_graph]", SE2, SE3) {
  Random random(5);
  constexpr std::uint32_t kPoses = 20000;
  const PoseMatrix<TestType> step = testCovariance<TestType>(1e-3, 1e-2);
  OdometryChain<TestType> chain(kPoses);
  REQUIRE(chain.beginComponent().ok());
  double farthest = 0;
  for (std::uint32_t k = 1; k < kPoses; ++k) {
    // Metre by metre on wide bends, a kilometre and more from the start.
    PoseVector<TestType> xi = 1e-3 * normalVector<TestType>(step / 1e-4, random);
    xi[PoseSpace<TestType>::kRotationDof - 1] += 3e-3 * std::sin(1e-3 * k);
    xi[PoseSpace<TestType>::kRotationDof] += 1;
    REQUIRE(chain.append(poseExp(xi), step).ok());
    farthest = std::max(farthest, chain.pose(k).translation.norm());
  }
  CHECK(farthest > 1000);  // metres: levers that make the sums large
  for (const std::uint32_t length : {1U, 2U, 10U, 100U, 1000U, 5000U}) {
    const std::uint32_t j = kPoses - 1;
    const PoseMatrix<TestType> direct = compounded(chain, step, j - length, j);
    const PoseMatrix<TestType> summed = chain.covariance(j - length, j);
    CAPTURE(length, direct, summed);
    // In units of the compounded one.
    const PoseMatrix<TestType> half = direct.llt().matrixL().solve(summed - direct);
    const PoseMatrix<TestType> relative = direct.llt().matrixL().solve(half.transpose());
    CHECK(relative.cwiseAbs().maxCoeff() < 1e-6);
  }
}

TEST_CASE("A chain refuses what it cannot hold and begins components", "[pose_graph]") {
  OdometryChain<SE2> chain(3);
  const PoseMatrix<SE2> Q = testCovariance<SE2>(0.01, 0.1);
  CHECK(chain.append(SE2(), Q).code == StatusCode::kInvalidInput);
  REQUIRE(chain.beginComponent().ok());
  SE2 broken;
  broken.angle = std::nan("");
  CHECK(chain.append(broken, Q).code == StatusCode::kInvalidInput);
  REQUIRE(chain.append(SE2(0.1, {1, 0}), Q).ok());
  REQUIRE(chain.beginComponent().ok());
  CHECK(chain.component(1) == 0);
  CHECK(chain.component(2) == 1);
  CHECK(chain.append(SE2(), Q).code == StatusCode::kCapacityReached);
  CHECK(chain.beginComponent().code == StatusCode::kCapacityReached);
}

}  // namespace
}  // namespace swiftlet
