#include "mapping/pose_graph/robust_graph.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>

#include "mapping/pose_graph/outlier_injection.hpp"
#include "tests/mapping/simulated_chain.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kPoses = 200;
constexpr std::uint32_t kTrue = 60;

/// A chain with true loops; poses are the odometry's.
template <typename Pose>
struct Walk {
  Random random;
  PoseMatrix<Pose> step = testCovariance<Pose>(2e-3, 1e-2);
  PoseMatrix<Pose> noise = testCovariance<Pose>(3e-3, 2e-2);
  SimulatedChain<Pose> chain;
  PoseGraph<Pose> graph;

  explicit Walk(std::uint64_t seed) : random(seed), chain(kPoses, step, random) {
    for (std::uint32_t k = 0; k < kPoses; ++k) {
      graph.poses.push_back(chain.odometry.pose(k));
      if (k > 0) graph.edges.push_back({k - 1, k, chain.odometry.relative(k - 1, k), step.inverse()});
    }
    for (std::uint32_t k = 0; k < kTrue; ++k) {
      const std::uint32_t from = random.below(kPoses - 20);
      addLoop(from, from + 10 + random.below(kPoses - from - 10));
    }
  }
  void addLoop(std::uint32_t from, std::uint32_t to) {
    graph.edges.push_back(chain.loop(from, to, noise, random));
  }
  [[nodiscard]] double error(const PoseGraph<Pose>& solved) const {
    double sum = 0;
    for (std::uint32_t k = 0; k < kPoses; ++k) {
      const Pose T = chain.truth[0].inverse() * chain.truth[k];
      sum += ((solved.poses[0].inverse() * solved.poses[k]).translation - T.translation).squaredNorm();
    }
    return std::sqrt(sum / kPoses);
  }
};

TEMPLATE_TEST_CASE("A graph is solved as if its false loops were not there", "[pose_graph]", SE2, SE3) {
  const Walk<TestType> walk(5);
  PoseGraph<TestType> clean = walk.graph;
  RobustGraphReport report;
  REQUIRE(solveRobustly(robustGraphSettings<TestType>(), {}, clean, report).ok());
  CHECK(report.components == 1);
  CHECK(report.loops == kTrue);
  CHECK(report.kept >= kTrue - 1);
  PoseGraph<TestType> spoiled = walk.graph;
  REQUIRE(injectOutliers({140, 3, 1}, spoiled).ok());
  const std::size_t own = walk.graph.edges.size();
  const PoseGraph<TestType> given = spoiled;
  REQUIRE(solveRobustly(robustGraphSettings<TestType>(), {}, spoiled, report).ok());
  REQUIRE(report.fates.size() == spoiled.edges.size());
  CHECK(report.loops == kTrue + 140);
  std::uint32_t lost = 0;
  std::uint32_t odometry = 0;
  for (std::size_t e = 0; e < spoiled.edges.size(); ++e) {
    const EdgeFate fate = report.fates[e];
    odometry += fate == EdgeFate::kOdometry ? 1U : 0U;
    if (e >= own) CHECK(fate != EdgeFate::kKept);
    if (e < own && fate != EdgeFate::kOdometry && fate != EdgeFate::kKept) ++lost;
  }
  CHECK(odometry == kPoses - 1);
  CHECK(lost <= 1);
  CHECK(walk.error(spoiled) == Approx(walk.error(clean)).epsilon(0.05));
  CHECK(walk.error(given) > 1.5 * walk.error(spoiled));
  // The same again, bit by bit.
  PoseGraph<TestType> again = given;
  RobustGraphReport other;
  REQUIRE(solveRobustly(robustGraphSettings<TestType>(), {}, again, other).ok());
  CHECK(other.fates == report.fates);
  CHECK(again.poses.back().translation == spoiled.poses.back().translation);
}

TEST_CASE("A loop that only the solved graph can vouch for comes back", "[pose_graph]") {
  // Odometry too vague to believe any loop on its own; neighbouring loops support each other.
  Random random(9);
  const PoseMatrix<SE2> vague = testCovariance<SE2>(0.05, 0.1);
  const PoseMatrix<SE2> noise = testCovariance<SE2>(1e-2, 1e-2);
  const SimulatedChain<SE2> chain(kPoses, vague, random);
  PoseGraph<SE2> graph;
  for (std::uint32_t k = 0; k < kPoses; ++k) {
    graph.poses.push_back(chain.odometry.pose(k));
    if (k > 0) graph.edges.push_back({k - 1, k, chain.odometry.relative(k - 1, k), vague.inverse()});
  }
  for (std::uint32_t k = 0; k < 30; ++k) {
    graph.edges.push_back(chain.loop(5 + k, 195 - k, noise, random));
  }
  const std::size_t alone = graph.edges.size();
  graph.edges.push_back(chain.loop(60, 110, noise, random));
  RobustGraphSettings settings = robustGraphSettings<SE2>();
  RobustGraphReport report;
  settings.method = RobustMethod::kSelection;
  PoseGraph<SE2> selected = graph;
  REQUIRE(solveRobustly(settings, {}, selected, report).ok());
  CHECK(report.fates[alone] == EdgeFate::kUnsupported);
  // With loops on both its ends it is still not supported in pairs of its own stretch, but the graph knows
  // it.
  for (std::uint32_t k = 0; k < 12; ++k) {
    graph.edges.push_back(chain.loop(40 + k, 64 + k, noise, random));
    graph.edges.push_back(chain.loop(66 + k, 104 + k, noise, random));
  }
  settings.method = RobustMethod::kSelectionAndGraduated;
  REQUIRE(solveRobustly(settings, {}, graph, report).ok());
  CHECK(report.fates[alone] == EdgeFate::kKept);
}

TEST_CASE("Loops of which none is proven prove each other, a single one is not believed", "[pose_graph]") {
  // Loops so vague that a random one agrees with the solution at a chance of 8e-4: every third graph with 400
  // random ones has one that does.
  Random random(11);
  const PoseMatrix<SE2> step = testCovariance<SE2>(1e-3, 5e-3);
  const SimulatedChain<SE2> chain(kPoses, step, random);
  const PoseMatrix<SE2> unit = testCovariance<SE2>(0.1, 1);
  const double log_unit =
      logChance<SE2>(cycleTest<SE2>(unit, PoseVector<SE2>::Zero()), chain.odometry.logBox(kPoses - 45));
  const PoseMatrix<SE2> noise = testCovariance<SE2>(0.1, std::exp(0.5 * (std::log(8e-4) - log_unit)));
  RobustGraphSettings settings = robustGraphSettings<SE2>();
  settings.selection.max_gate_chance = 1e-2;
  for (const std::uint32_t loops : {1U, 40U}) {
    PoseGraph<SE2> graph;
    for (std::uint32_t k = 0; k < kPoses; ++k) {
      graph.poses.push_back(chain.odometry.pose(k));
      if (k > 0) graph.edges.push_back({k - 1, k, chain.odometry.relative(k - 1, k), step.inverse()});
    }
    const std::size_t first = graph.edges.size();
    for (std::uint32_t k = 0; k < loops; ++k) {
      graph.edges.push_back(chain.loop(kPoses - 60 + k, kPoses - 45 + k, noise, random));
    }
    REQUIRE(injectOutliers({400, 5, 1}, graph).ok());
    RobustGraphReport report;
    REQUIRE(solveRobustly(settings, {}, graph, report).ok());
    const auto kept = [&](std::size_t from, std::size_t to) {
      return std::count(report.fates.begin() + static_cast<std::ptrdiff_t>(from),
                        report.fates.begin() + static_cast<std::ptrdiff_t>(to), EdgeFate::kKept);
    };
    CHECK(kept(first + loops, graph.edges.size()) == 0);
    if (loops == 1) {
      CHECK(kept(first, first + loops) == 0);
    } else {
      CHECK(kept(first, first + loops) >= 30);
    }
  }
}

TEST_CASE("Odometry is found turned round, broken and doubled", "[pose_graph]") {
  Walk<SE2> walk(6);
  auto& edges = walk.graph.edges;
  const auto turn = [](RelativePose<SE2>& edge) {
    const PoseMatrix<SE2> adjoint = poseAdjoint(edge.T_from_to.inverse());
    // zeta' = -Ad(Z) zeta, so its information is Ad(Z)^-T I Ad(Z)^-1.
    edge.information = (adjoint.transpose() * edge.information * adjoint).eval();
    edge.T_from_to = edge.T_from_to.inverse();
    std::swap(edge.from, edge.to);
  };
  turn(edges[10]);
  edges.push_back(edges[20]);
  edges[100].from = 0;  // 100 -> 101 is no more: a loop in its place, a false one
  OdometryChain<SE2> chain(kPoses);
  std::vector<bool> is_odometry;
  REQUIRE(chainOdometry(walk.graph, chain, is_odometry).ok());
  CHECK(chain.components() == 2);
  CHECK(is_odometry[10]);
  CHECK(is_odometry[20]);
  CHECK_FALSE(is_odometry[100]);
  CHECK_FALSE(is_odometry.back());
  CHECK((chain.pose(50).translation - walk.chain.odometry.pose(50).translation).norm() < 1e-9);
  CHECK((chain.cumulated(50) - walk.chain.odometry.cumulated(50)).norm() <
        1e-9 * walk.chain.odometry.cumulated(50).norm());
  RobustGraphReport report;
  REQUIRE(solveRobustly(robustGraphSettings<SE2>(), {}, walk.graph, report).ok());
  CHECK(report.components == 2);
  CHECK(report.fates[100] != EdgeFate::kKept);
  CHECK(report.fates.back() == EdgeFate::kKept);
}

TEST_CASE("More loops than can be compared, and edges to nowhere, are refused and change nothing",
          "[pose_graph]") {
  Walk<SE2> walk(7);
  RobustGraphSettings settings = robustGraphSettings<SE2>();
  settings.max_candidates = 10;
  RobustGraphReport report;
  const auto before = walk.graph.poses;
  CHECK(solveRobustly(settings, {}, walk.graph, report).code == StatusCode::kCapacityReached);
  CHECK(walk.graph.poses.back().translation == before.back().translation);
  walk.graph.edges.back().to = kPoses;
  CHECK(solveRobustly(robustGraphSettings<SE2>(), {}, walk.graph, report).code == StatusCode::kInvalidInput);
}

}  // namespace
}  // namespace swiftlet
