#include "mapping/pose_graph/loop_consistency.hpp"

#include <catch2/catch.hpp>
#include <functional>

#include "mapping/pose_graph/loop_selection.hpp"
#include "tests/mapping/simulated_chain.hpp"

namespace swiftlet {
namespace {

struct Rates {
  double mean = 0;     ///< of chi-squared over its degrees of freedom: 1
  double beyond5 = 0;  ///< share beyond the 5 % quantile: 0.05
  double beyond1 = 0;
};

template <typename Pose>
Rates ratesOf(int draws, const std::function<double(Random&)>& chiSquared) {
  constexpr int kDof = PoseSpace<Pose>::kDof;
  const double limit5 = chiSquaredOfTail(kDof, 0.05);
  const double limit1 = chiSquaredOfTail(kDof, 0.01);
  Rates rates;
  Random random(11);
  for (int k = 0; k < draws; ++k) {
    const double value = chiSquared(random);
    rates.mean += value / kDof / draws;
    rates.beyond5 += (value > limit5 ? 1.0 : 0.0) / draws;
    rates.beyond1 += (value > limit1 ? 1.0 : 0.0) / draws;
  }
  return rates;
}

void checkRates(const Rates& rates) {
  // 4000 draws: three standard deviations of each figure.
  CHECK(rates.mean == Approx(1).margin(0.04));
  CHECK(rates.beyond5 == Approx(0.05).margin(0.0105));
  CHECK(rates.beyond1 == Approx(0.01).margin(0.005));
}

constexpr int kDraws = 4000;

TEST_CASE("Quantiles of chi-squared are those of the tables", "[pose_graph]") {
  CHECK(chiSquaredOfTail(3, 0.01) == Approx(11.3449).epsilon(1e-5));
  CHECK(chiSquaredOfTail(6, 0.01) == Approx(16.8119).epsilon(1e-5));
  CHECK(chiSquaredOfTail(3, 0.5) == Approx(2.36597).epsilon(1e-5));
  CHECK(chiSquaredOfTail(6, 1e-6) == Approx(38.2583).epsilon(1e-4));
}

TEMPLATE_TEST_CASE("True loops fail the odometry's test as often as its threshold says", "[pose_graph]", SE2,
                   SE3) {
  const PoseMatrix<TestType> step = testCovariance<TestType>(1e-3, 1e-2);
  const PoseMatrix<TestType> noise = testCovariance<TestType>(3e-3, 2e-2);
  checkRates(ratesOf<TestType>(kDraws, [&](Random& random) {
    const SimulatedChain<TestType> chain(40, step, random);
    // Given either way round.
    const bool turned = random.below(2) == 0;
    const RelativePose<TestType> loop =
        turned ? chain.loop(35, 4, noise, random) : chain.loop(4, 35, noise, random);
    return odometryTest(chain.odometry, chainLoop(chain.odometry, loop)).chi_squared;
  }));
}

TEMPLATE_TEST_CASE("True pairs fail as often as the threshold says, whatever their order along the chain",
                   "[pose_graph]", SE2, SE3) {
  const PoseMatrix<TestType> step = testCovariance<TestType>(2e-3, 2e-2);
  const PoseMatrix<TestType> noise = testCovariance<TestType>(1e-3, 1e-2);
  // from, to of two loops: apart, nested, crossing, one within the steps between the other's ends (the cycle
  // goes along the same steps twice, in both ways), and with a common end.
  const std::uint32_t ends[][4] = {{2, 30, 6, 36},  {2, 36, 6, 30}, {6, 30, 2, 36},  {2, 12, 9, 36},
                                   {20, 38, 2, 24}, {5, 38, 5, 30}, {3, 20, 20, 37}, {2, 20, 24, 37}};
  for (const auto& e : ends) {
    CAPTURE(e[0], e[1], e[2], e[3]);
    checkRates(ratesOf<TestType>(kDraws, [&](Random& random) {
      const SimulatedChain<TestType> chain(40, step, random);
      const auto a = chainLoop(chain.odometry, chain.loop(e[0], e[1], noise, random));
      const auto b = chainLoop(chain.odometry, chain.loop(e[2], e[3], noise, random));
      return PairTest<TestType>(chain.odometry, a).against(b).chi_squared;
    }));
  }
}

TEST_CASE("Loops across two components are tested against each other only", "[pose_graph]") {
  const PoseMatrix<SE3> step = testCovariance<SE3>(1e-3, 1e-2);
  const PoseMatrix<SE3> noise = testCovariance<SE3>(1e-3, 1e-2);
  checkRates(ratesOf<SE3>(kDraws, [&](Random& random) {
    // One way, cut in two: the second part starts anew at its own origin.
    const SimulatedChain<SE3> whole(40, step, random);
    OdometryChain<SE3> cut(40);
    (void)cut.beginComponent();
    for (std::uint32_t k = 1; k < 40; ++k) {
      (void)(k == 20 ? cut.beginComponent() : cut.append(whole.odometry.relative(k - 1, k), step));
    }
    const auto a = chainLoop(cut, whole.loop(3, 25, noise, random));
    const auto b = chainLoop(cut, whole.loop(35, 9, noise, random));
    const auto within = chainLoop(cut, whole.loop(3, 15, noise, random));
    REQUIRE_FALSE(a.withinComponent());
    REQUIRE(std::isinf(PairTest<SE3>(cut, a).against(within).chi_squared));
    return PairTest<SE3>(cut, a).against(b).chi_squared;
  }));
}

TEST_CASE("A pair test does not depend on which loop comes first", "[pose_graph]") {
  Random random(2);
  const SimulatedChain<SE3> chain(60, testCovariance<SE3>(1e-3, 1e-2), random);
  const PoseMatrix<SE3> noise = testCovariance<SE3>(1e-3, 1e-2);
  for (int k = 0; k < 100; ++k) {
    const std::uint32_t from = random.below(30);
    const auto a = chainLoop(chain.odometry, chain.loop(from, from + 20, noise, random));
    const auto b = chainLoop(chain.odometry, chain.loop(58 - from, 3, noise, random));
    const double forth = PairTest<SE3>(chain.odometry, a).against(b).chi_squared;
    const double back = PairTest<SE3>(chain.odometry, b).against(a).chi_squared;
    CHECK(back == Approx(forth).epsilon(0.05));  // equal to first order
  }
}

TEST_CASE("Directions without information are not looked at", "[pose_graph]") {
  Random random(2);
  const SimulatedChain<SE2> chain(40, testCovariance<SE2>(1e-3, 1e-2), random);
  RelativePose<SE2> loop = chain.loop(2, 30, testCovariance<SE2>(1e-3, 1e-2), random);
  loop.information = PoseMatrix<SE2>::Zero();
  loop.information(0, 0) = 1e6;                           // only the angle is known
  loop.T_from_to.translation += Eigen::Vector2d(10, 10);  // metres, far beyond the odometry's errors
  CHECK(odometryTest(chain.odometry, chainLoop(chain.odometry, loop)).chi_squared < 20);
  loop.T_from_to.angle += 0.1;
  CHECK(odometryTest(chain.odometry, chainLoop(chain.odometry, loop)).chi_squared > 50);
}

}  // namespace
}  // namespace swiftlet
