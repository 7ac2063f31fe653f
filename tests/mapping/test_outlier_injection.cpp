#include "mapping/pose_graph/outlier_injection.hpp"

#include <catch2/catch.hpp>

#include "mapping/pose_graph/loop_selection.hpp"
#include "tests/mapping/simulated_chain.hpp"

namespace swiftlet {
namespace {

template <typename Pose>
PoseGraph<Pose> simulatedGraph() {
  Random random(1);
  const PoseMatrix<Pose> step = testCovariance<Pose>(1e-3, 1e-2);
  const SimulatedChain<Pose> chain(200, step, random);
  PoseGraph<Pose> graph;
  for (std::uint32_t k = 0; k < 200; ++k) {
    graph.poses.push_back(chain.odometry.pose(k));
    if (k > 0) {
      graph.edges.push_back({k - 1, k, chain.odometry.relative(k - 1, k), step.inverse()});
    }
  }
  graph.edges.push_back(chain.loop(10, 150, 4 * step, random));
  return graph;
}

TEMPLATE_TEST_CASE("False loops: the same for the same seed, within the scene, with a loop's information",
                   "[pose_graph]", SE2, SE3) {
  const PoseGraph<TestType> graph = simulatedGraph<TestType>();
  PoseGraph<TestType> first = graph;
  PoseGraph<TestType> second = graph;
  PoseGraph<TestType> other = graph;
  REQUIRE(injectOutliers({1000, 7, 1}, first).ok());
  REQUIRE(injectOutliers({1000, 7, 1}, second).ok());
  REQUIRE(injectOutliers({1000, 8, 1}, other).ok());
  REQUIRE(first.edges.size() == graph.edges.size() + 1000);
  auto low = graph.poses[0].translation;
  auto high = low;
  for (const auto& T : graph.poses) {
    low = low.cwiseMin(T.translation);
    high = high.cwiseMax(T.translation);
  }
  std::size_t equal_to_other = 0;
  double mean_gap = 0;
  for (std::size_t k = graph.edges.size(); k < first.edges.size(); ++k) {
    const auto& edge = first.edges[k];
    CHECK(edge.from + 2 <= edge.to);
    CHECK(edge.to < 200);
    CHECK(edge.information == graph.edges.back().information);
    CHECK(edge.from == second.edges[k].from);
    CHECK(edge.T_from_to.translation == second.edges[k].T_from_to.translation);
    equal_to_other += edge.from == other.edges[k].from && edge.to == other.edges[k].to ? 1U : 0U;
    const auto place = (graph.poses[edge.from] * edge.T_from_to).translation.eval();
    CHECK((place.array() > low.array() - 1e-9).all());
    CHECK((place.array() < high.array() + 1e-9).all());
    mean_gap += (edge.to - edge.from) / 1000.0;
  }
  CHECK(equal_to_other < 10);
  CHECK(mean_gap == Approx(200 / 3.0).margin(5));  // of uniform pairs
  CHECK(outlierCount(100, 0.9) == 900);
  CHECK(outlierCount(100, 0.5) == 100);
  CHECK(outlierCount(100, 0) == 0);
}

TEMPLATE_TEST_CASE("Loops of a group agree with each other as true ones do", "[pose_graph]", SE2, SE3) {
  PoseGraph<TestType> graph = simulatedGraph<TestType>();
  const std::size_t own = graph.edges.size();
  REQUIRE(injectOutliers({48, 7, 10}, graph).ok());
  REQUIRE(graph.edges.size() == own + 48);
  OdometryChain<TestType> chain(200);
  (void)chain.beginComponent();
  for (std::uint32_t k = 1; k < 200; ++k) {
    (void)chain.append(graph.edges[k - 1].T_from_to, graph.edges[k - 1].information.inverse());
  }
  const double limit = chiSquaredOfTail(PoseSpace<TestType>::kDof, 1e-6);
  for (std::size_t a = own; a < graph.edges.size(); ++a) {
    const auto loop = chainLoop(chain, graph.edges[a]);
    for (std::size_t b = own; b < a; ++b) {
      const bool same_group = (a - own) / 10 == (b - own) / 10;
      const double value =
          PairTest<TestType>(chain, loop).against(chainLoop(chain, graph.edges[b])).chi_squared;
      CHECK((value < limit) == same_group);
    }
  }
}

TEST_CASE("A graph too small for false loops is left as it was", "[pose_graph]") {
  PoseGraph<SE2> graph;
  graph.poses.resize(2);
  graph.edges.push_back({0, 1, SE2(), PoseMatrix<SE2>::Identity()});
  CHECK(injectOutliers({5, 1, 1}, graph).code == StatusCode::kInvalidInput);
  CHECK(graph.edges.size() == 1);
  graph.poses.resize(3);
  CHECK(injectOutliers({5, 1, 1}, graph).ok());
  CHECK(graph.edges.size() == 6);
  CHECK(injectOutliers({5, 1, 2}, graph).code == StatusCode::kInvalidInput);
}

}  // namespace
}  // namespace swiftlet
