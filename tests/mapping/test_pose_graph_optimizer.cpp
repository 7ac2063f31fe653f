// The optimizer: known answers, covariances beside a dense inverse, incremental use, limits.

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>

#include "mapping/pose_graph/odometry_start.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "tests/mapping/random_graph.hpp"

namespace swiftlet::test {
namespace {

template <typename Pose>
PoseGraphOptimizer<Pose> optimizerOf(const PoseGraph<Pose>& graph) {
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  REQUIRE(optimizer.assign(graph).ok());
  return optimizer;
}

/// Dense normal equations by the poses' tangents, pose 0 held; and their gradient.
template <typename Pose>
Eigen::MatrixXd denseInformation(const PoseGraph<Pose>& graph, Eigen::VectorXd& gradient) {
  constexpr int kDof = PoseSpace<Pose>::kDof;
  const auto size = static_cast<Eigen::Index>(graph.poses.size()) * kDof;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
  gradient = Eigen::VectorXd::Zero(size);
  for (const RelativePose<Pose>& edge : graph.edges) {
    const EdgeLinearization<Pose> lin =
        linearized(edge.T_from_to, graph.poses[edge.from], graph.poses[edge.to]);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(kDof, size);
    J.middleCols<kDof>(edge.from * kDof) = -lin.jacobian_to * lin.adjoint;
    J.middleCols<kDof>(edge.to * kDof) = lin.jacobian_to;
    H += J.transpose() * edge.information * J;
    gradient += J.transpose() * edge.information * lin.error;
  }
  gradient = gradient.tail(size - kDof).eval();
  return H.bottomRightCorner(size - kDof, size - kDof);
}

template <typename Pose>
void checkExactGraph(std::uint64_t seed) {
  TrueGraph<Pose> made = randomGraph<Pose>(seed, 60, 40, 0.0);
  Random random(seed);
  for (std::size_t k = 1; k < made.graph.poses.size(); ++k)
    made.graph.poses[k] = randomPose<Pose>(random, 3.0);
  auto optimizer = optimizerOf(made.graph);
  StartReport start;
  REQUIRE(optimizer.start(start).ok());
  CHECK(start.choice == StartChoice::kChordal);
  // Without noise the chordal start is the truth.
  CHECK(poseDifference(optimizer.graph().poses, made.truth) < 1e-6);
  OptimizeReport report;
  REQUIRE(optimizer.optimize({}, report).ok());
  CHECK(report.converged);
  CHECK(report.final_cost < 1e-9);
  CHECK(poseDifference(optimizer.graph().poses, made.truth) < 1e-6);
}

TEST_CASE("without noise the truth comes back, from nowhere") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    checkExactGraph<SE2>(seed);
    checkExactGraph<SE3>(seed);
  }
}

template <typename Pose>
void checkNoisyGraph(std::uint64_t seed) {
  const TrueGraph<Pose> made = randomGraph<Pose>(seed, 40, 30, 0.1);
  auto optimizer = optimizerOf(made.graph);
  OptimizeReport report;
  OptimizeEffort effort;
  effort.tolerance = 1e-14;
  REQUIRE(optimizer.optimize(effort, report).ok());
  CHECK(report.converged);
  CHECK(report.final_cost < report.initial_cost);
  CHECK(report.final_cost == Approx(optimizer.cost()).epsilon(1e-12));
  CHECK(optimizer.cost() == Approx(graphCost(optimizer.graph())).epsilon(1e-12));
  // A minimum: no slope left, against slopes of the size of the information before.
  Eigen::VectorXd gradient;
  const Eigen::MatrixXd H = denseInformation(optimizer.graph(), gradient);
  CHECK(gradient.norm() < 1e-4);
  // Covariances are blocks of the dense inverse.
  constexpr int kDof = PoseSpace<Pose>::kDof;
  const Eigen::MatrixXd inverse = H.inverse();
  typename PoseGraphOptimizer<Pose>::Covariance covariance;
  for (const std::size_t pose : {1U, 17U, 39U}) {
    REQUIRE(optimizer.covariance(pose, covariance).ok());
    const auto at = static_cast<Eigen::Index>(pose - 1) * kDof;
    CHECK((covariance - inverse.block<kDof, kDof>(at, at)).norm() < 1e-9 * covariance.norm());
  }
  REQUIRE(optimizer.covariance(0, covariance).ok());
  CHECK(covariance.norm() == 0);
  // Of T_from_to: differences of the two poses' tangents through the numeric derivative.
  const std::size_t from = 5;
  const std::size_t to = 30;
  REQUIRE(optimizer.relativeCovariance(from, to, covariance).ok());
  const Pose T = optimizer.graph().poses[from].inverse() * optimizer.graph().poses[to];
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(kDof, inverse.cols());
  for (int k = 0; k < kDof; ++k) {
    constexpr double kStep = 1e-6;
    PoseTangent<Pose> step = PoseTangent<Pose>::Zero();
    step[k] = kStep;
    const auto& poses = optimizer.graph().poses;
    J.col(static_cast<Eigen::Index>(from - 1) * kDof + k) =
        relativeError(T, retracted(poses[from], step), poses[to]) / kStep;
    J.col(static_cast<Eigen::Index>(to - 1) * kDof + k) =
        relativeError(T, poses[from], retracted(poses[to], step)) / kStep;
  }
  const PoseBlock<Pose> expected = J * inverse * J.transpose();
  CHECK((covariance - expected).norm() < 1e-4 * expected.norm());
  PoseBlock<Pose> again;
  REQUIRE(optimizer.relativeCovariance(0, to, again).ok());
  REQUIRE(optimizer.covariance(to, covariance).ok());
  CHECK((again - covariance).norm() < 1e-9 * covariance.norm());
}

TEST_CASE("the minimum has no slope, and covariances are those of the dense inverse") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    checkNoisyGraph<SE2>(seed);
    checkNoisyGraph<SE3>(seed);
  }
}

TEST_CASE("one measured step is taken, and its covariance is the inverse of its information") {
  Random random(4);
  PoseGraph<SE3> graph;
  graph.poses.resize(2);
  graph.edges.push_back({0, 1, randomPose<SE3>(random, 0.8), randomInformation<SE3>(random)});
  auto optimizer = optimizerOf(graph);
  OptimizeReport report;
  REQUIRE(optimizer.optimize({}, report).ok());
  CHECK(report.final_cost < 1e-9);
  CHECK(relativeError(graph.edges[0].T_from_to, SE3(), optimizer.graph().poses[1]).norm() < 1e-5);
  PoseGraphOptimizer<SE3>::Covariance covariance;
  REQUIRE(optimizer.relativeCovariance(0, 1, covariance).ok());
  const PoseBlock<SE3> expected = graph.edges[0].information.inverse();
  CHECK((covariance - expected).norm() < 1e-4 * expected.norm());
}

TEST_CASE("held poses stay, pieces are held by their first pose") {
  const TrueGraph<SE2> a = randomGraph<SE2>(1, 20, 10, 0.1);
  PoseGraph<SE2> both = a.graph;
  for (const SE2& pose : a.truth) both.poses.push_back(SE2(1.0, {50, 0}) * pose);
  for (RelativePose<SE2> edge : a.graph.edges) {
    edge.from += 20;
    edge.to += 20;
    both.edges.push_back(edge);
  }
  auto optimizer = optimizerOf(both);
  OptimizeReport report;
  REQUIRE(optimizer.optimize({}, report).ok());
  CHECK(optimizer.layout().pieces == 2);
  CHECK(optimizer.layout().held == std::vector<std::uint32_t>{0, 20});
  CHECK(poseDifference<SE2>({optimizer.graph().poses[20]}, {both.poses[20]}) == 0);
  // The two pieces are one problem twice.
  auto alone = optimizerOf(a.graph);
  OptimizeReport alone_report;
  REQUIRE(alone.optimize({}, alone_report).ok());
  CHECK(report.final_cost == Approx(2 * alone_report.final_cost).epsilon(1e-6));

  REQUIRE(optimizer.hold(33, true).ok());
  REQUIRE(optimizer.setPose(33, SE2(0.5, {7, 8})).ok());
  REQUIRE(optimizer.optimize({}, report).ok());
  CHECK(optimizer.layout().held == std::vector<std::uint32_t>{0, 33});
  CHECK(poseDifference<SE2>({optimizer.graph().poses[33]}, {SE2(0.5, {7, 8})}) == 0);
  CHECK(report.final_cost == Approx(2 * alone_report.final_cost).epsilon(1e-6));
}

TEST_CASE("an edge of weight zero is not there") {
  const TrueGraph<SE3> made = randomGraph<SE3>(6, 30, 20, 0.05);
  PoseGraph<SE3> spoiled = made.graph;
  RelativePose<SE3> wrong = made.graph.edges.back();
  Random random(2);
  wrong.T_from_to = randomPose<SE3>(random, 2.0);
  spoiled.edges.push_back(wrong);
  auto good = optimizerOf(made.graph);
  auto other = optimizerOf(spoiled);
  OptimizeReport report;
  REQUIRE(good.optimize({}, report).ok());
  const double best = report.final_cost;
  REQUIRE(other.optimize({}, report).ok());
  CHECK(report.final_cost > 1.5 * best);
  REQUIRE(other.setWeight(spoiled.edges.size() - 1, 0).ok());
  REQUIRE(other.optimize({}, report).ok());
  CHECK(report.final_cost == Approx(best).epsilon(1e-6));
  // Half of all weights: half of the cost at the same poses.
  for (std::size_t e = 0; e + 1 < spoiled.edges.size(); ++e) REQUIRE(other.setWeight(e, 0.5).ok());
  CHECK(other.cost() == Approx(0.5 * best).epsilon(1e-6));
}

TEST_CASE("a graph grown bit by bit ends where the whole one does") {
  const TrueGraph<SE2> made = randomGraph<SE2>(8, 120, 60, 0.03);
  PoseGraphOptimizer<SE2> grown({120, made.graph.edges.size(), 200000});
  REQUIRE(grown.addPose(made.graph.poses[0]).ok());
  OptimizeReport report;
  OptimizeEffort little;
  little.iterations = 2;
  for (std::uint32_t k = 1; k < 120; ++k) {
    REQUIRE(grown.addPose(grown.graph().poses[k - 1] * made.graph.edges[k - 1].T_from_to).ok());
    REQUIRE(grown.addEdge(made.graph.edges[k - 1]).ok());
    for (std::size_t e = 119; e < made.graph.edges.size(); ++e) {
      const RelativePose<SE2>& loop = made.graph.edges[e];
      if (std::max(loop.from, loop.to) != k) continue;
      REQUIRE(grown.addEdge(loop).ok());
      REQUIRE(grown.optimize(little, report).ok());
      CHECK(report.iterations <= 2);
      CHECK(report.final_cost <= report.initial_cost * (1 + 1e-12));
    }
  }
  REQUIRE(grown.optimize({}, report).ok());
  auto whole = optimizerOf(made.graph);
  OptimizeReport whole_report;
  REQUIRE(whole.optimize({}, whole_report).ok());
  CHECK(report.final_cost == Approx(whole_report.final_cost).epsilon(1e-6));
  // Back to the first half.
  std::size_t edges = 0;
  while (edges < grown.graph().edges.size() &&
         std::max(grown.graph().edges[edges].from, grown.graph().edges[edges].to) < 60) {
    ++edges;
  }
  REQUIRE(grown.truncate(60, edges).ok());
  REQUIRE(grown.optimize({}, report).ok());
  CHECK(grown.graph().poses.size() == 60);
  CHECK_FALSE(grown.truncate(61, edges).ok());
  CHECK_FALSE(grown.truncate(10, edges).ok());
}

TEST_CASE("an edge beside another counts, without a new arrangement") {
  const TrueGraph<SE3> made = randomGraph<SE3>(13, 30, 15, 0.1);
  PoseGraph<SE3> twice = made.graph;
  twice.edges.insert(twice.edges.end(), made.graph.edges.begin(), made.graph.edges.end());
  auto whole = optimizerOf(twice);
  PoseGraphOptimizer<SE3> grown({30, twice.edges.size(), 0});
  REQUIRE(grown.assign(made.graph).ok());
  OptimizeReport report;
  OptimizeReport whole_report;
  REQUIRE(grown.optimize({}, report).ok());
  const double once = report.final_cost;
  for (const RelativePose<SE3>& edge : made.graph.edges) {
    REQUIRE(grown.addEdge(edge).ok());
  }
  REQUIRE(grown.optimize({}, report).ok());
  REQUIRE(whole.optimize({}, whole_report).ok());
  CHECK(report.initial_cost == Approx(2 * once).epsilon(1e-9));
  CHECK(report.final_cost == Approx(whole_report.final_cost).epsilon(1e-6));
  // One reversed edge that lies: it pulls.
  RelativePose<SE3> wrong;
  wrong.from = 11;
  wrong.to = 10;
  wrong.T_from_to = SE3(Eigen::Quaterniond::Identity(), {5, 0, 0});
  REQUIRE(grown.addEdge(wrong).code == StatusCode::kCapacityReached);
  REQUIRE(grown.truncate(30, twice.edges.size() - 1).ok());
  REQUIRE(grown.optimize({}, report).ok());
  REQUIRE(grown.addEdge(wrong).ok());
  OptimizeEffort effort;
  effort.tolerance = 1e-12;
  REQUIRE(grown.optimize(effort, report).ok());
  CHECK(report.converged);
  PoseGraph<SE3> same = grown.graph();
  auto fresh = optimizerOf(same);
  OptimizeReport fresh_report;
  REQUIRE(fresh.optimize(effort, fresh_report).ok());
  CHECK(fresh_report.initial_cost - fresh_report.final_cost < 1e-6 * fresh_report.initial_cost);
  CHECK(report.final_cost < report.initial_cost);
}

TEST_CASE("the same graph gives the same bytes") {
  const TrueGraph<SE3> made = randomGraph<SE3>(11, 80, 60, 0.1);
  std::vector<SE3> first;
  for (int round = 0; round < 2; ++round) {
    auto optimizer = optimizerOf(made.graph);
    StartReport start;
    OptimizeReport report;
    REQUIRE(optimizer.start(start).ok());
    REQUIRE(optimizer.optimize({}, report).ok());
    if (round == 0) {
      first = optimizer.graph().poses;
    } else {
      for (std::size_t k = 0; k < first.size(); ++k) {
        CHECK(first[k].rotation.coeffs() == optimizer.graph().poses[k].rotation.coeffs());
        CHECK(first[k].translation == optimizer.graph().poses[k].translation);
      }
    }
  }
}

TEST_CASE("what is full or wrong is refused, and nothing is added") {
  PoseGraphOptimizer<SE2> optimizer({2, 1, 0});
  OptimizeReport report;
  CHECK(optimizer.optimize({}, report).code == StatusCode::kNotReady);
  CHECK(optimizer.addPose(SE2(std::nan(""), {0, 0})).code == StatusCode::kInvalidInput);
  REQUIRE(optimizer.addPose({}).ok());
  REQUIRE(optimizer.addPose({}).ok());
  CHECK(optimizer.addPose({}).code == StatusCode::kCapacityReached);
  RelativePose<SE2> edge;
  edge.to = 2;
  CHECK(optimizer.addEdge(edge).code == StatusCode::kInvalidInput);
  edge.to = 0;
  CHECK(optimizer.addEdge(edge).code == StatusCode::kInvalidInput);
  edge.to = 1;
  edge.information(0, 1) = 0.5;
  CHECK(optimizer.addEdge(edge).code == StatusCode::kInvalidInput);
  edge.information(0, 1) = std::nan("");
  CHECK(optimizer.addEdge(edge).code == StatusCode::kInvalidInput);
  edge.information.setIdentity();
  CHECK(optimizer.graph().edges.empty());
  REQUIRE(optimizer.addEdge(edge).ok());
  CHECK(optimizer.addEdge(edge).code == StatusCode::kCapacityReached);
  CHECK(optimizer.setWeight(1, 1).code == StatusCode::kInvalidInput);
  CHECK(optimizer.setWeight(0, -1).code == StatusCode::kInvalidInput);
  CHECK(optimizer.hold(2, true).code == StatusCode::kInvalidInput);
  CHECK(optimizer.optimize({}, report).ok());

  PoseGraphOptimizer<SE3> small({100, 200, 100});
  const TrueGraph<SE3> made = randomGraph<SE3>(3, 30, 20, 0.1);
  REQUIRE(small.assign(made.graph).ok());
  CHECK(small.optimize({}, report).code == StatusCode::kCapacityReached);
}

TEST_CASE("information of low rank leaves poses where they are, and says so for covariances") {
  // Only the distance along x is measured.
  PoseGraph<SE2> graph;
  graph.poses.resize(2);
  RelativePose<SE2> edge{0, 1, SE2(0, {2, 0}), {}};
  edge.information.setZero();
  edge.information(1, 1) = 4;
  graph.edges.push_back(edge);
  auto optimizer = optimizerOf(graph);
  OptimizeReport report;
  REQUIRE(optimizer.optimize({}, report).ok());
  CHECK(report.final_cost < 1e-9);
  CHECK(optimizer.graph().poses[1].translation.x() == Approx(2).epsilon(1e-4));
  CHECK(std::abs(optimizer.graph().poses[1].angle) < 1e-9);
  PoseGraphOptimizer<SE2>::Covariance covariance;
  CHECK(optimizer.covariance(1, covariance).code == StatusCode::kNumerical);
}

TEST_CASE("odometry comes before loops in the first poses") {
  TrueGraph<SE3> made = randomGraph<SE3>(12, 50, 30, 0.0);
  // Loops that lie, in front of the odometry.
  std::vector<RelativePose<SE3>> edges(made.graph.edges.begin() + 49, made.graph.edges.end());
  for (RelativePose<SE3>& edge : edges) {
    if (edge.to != edge.from + 1 && edge.from != edge.to + 1) edge.T_from_to.translation.x() += 10;
  }
  edges.insert(edges.end(), made.graph.edges.begin(), made.graph.edges.begin() + 49);
  // One odometry edge the other way around, one missing but for a true loop.
  std::swap(edges[40].from, edges[40].to);
  edges[40].T_from_to = edges[40].T_from_to.inverse();
  made.graph.edges = edges;
  odometryStart(made.graph);
  CHECK(poseDifference(made.graph.poses, made.truth) < 1e-9);
}

}  // namespace
}  // namespace swiftlet::test
