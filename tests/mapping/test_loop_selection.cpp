#include "mapping/pose_graph/loop_selection.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "tests/mapping/simulated_chain.hpp"

namespace swiftlet {
namespace {

constexpr std::uint32_t kNodes = 2000;

template <typename Pose>
PoseMatrix<Pose> stepCovariance() {
  return testCovariance<Pose>(2e-3, 1e-2);
}
template <typename Pose>
PoseMatrix<Pose> loopCovariance() {
  return testCovariance<Pose>(3e-3, 2e-2);
}

/// True loops and false ones in a random order; false ones lie a few metres off or come in agreeing groups.
template <typename Pose>
struct Scene {
  Random random;
  SimulatedChain<Pose> chain;
  std::vector<RelativePose<Pose>> loops;
  std::vector<bool> is_true;

  Scene(std::uint32_t poses, std::uint64_t seed)
      : random(seed), chain(poses, stepCovariance<Pose>(), random) {}

  std::pair<std::uint32_t, std::uint32_t> ends() {
    const auto poses = static_cast<std::uint32_t>(chain.truth.size());
    const std::uint32_t from = random.below(poses - 20);
    return {from, from + 10 + random.below(poses - from - 10)};
  }
  void addTrue() {
    const auto [from, to] = ends();
    loops.push_back(chain.loop(from, to, loopCovariance<Pose>(), random));
    is_true.push_back(true);
  }
  void addFalse(double metres) {
    const auto [from, to] = ends();
    RelativePose<Pose> loop = chain.loop(from, to, loopCovariance<Pose>(), random);
    for (int k = 0; k < loop.T_from_to.translation.size(); ++k) {
      loop.T_from_to.translation[k] += metres * random.normal();
    }
    loops.push_back(loop);
    is_true.push_back(false);
  }
  void fill(int true_loops, int false_loops) {
    while (true_loops + false_loops > 0) {
      if (static_cast<int>(random.below(static_cast<std::uint32_t>(true_loops + false_loops))) < true_loops) {
        addTrue();
        --true_loops;
      } else {
        addFalse(5);
        --false_loops;
      }
    }
  }
};

template <typename Pose>
LoopSelection<Pose> selectionFor(const Scene<Pose>& scene, std::uint32_t max_loops,
                                 const LoopSelectionSettings& settings = loopSelectionSettings<Pose>()) {
  const auto poses = static_cast<std::uint32_t>(scene.chain.truth.size());
  LoopSelection<Pose> selection({poses, max_loops}, settings);
  (void)selection.odometry().beginComponent();
  for (std::uint32_t k = 1; k < poses; ++k) {
    (void)selection.odometry().append(scene.chain.odometry.relative(k - 1, k), stepCovariance<Pose>());
  }
  return selection;
}

std::vector<std::uint32_t> copyOf(std::span<const std::uint32_t> ids) { return {ids.begin(), ids.end()}; }

TEMPLATE_TEST_CASE("True loops are kept and false ones rejected", "[pose_graph]", SE2, SE3) {
  Scene<TestType> scene(300, 21);
  scene.fill(60, 120);
  LoopSelection<TestType> selection = selectionFor(scene, 200);
  std::uint32_t id = 0;
  for (const auto& loop : scene.loops) {
    REQUIRE(selection.addLoop(loop, kNodes, id).ok());
  }
  std::uint32_t kept_true = 0;
  std::uint32_t kept_false = 0;
  for (const std::uint32_t k : selection.selected()) {
    (scene.is_true[k] ? kept_true : kept_false) += 1;
    CHECK(selection.verdict(k) == LoopVerdict::kSelected);
  }
  CHECK(selection.exact());
  CHECK(kept_true >= 57);
  CHECK(kept_false <= 3);
}

TEMPLATE_TEST_CASE("Loop by loop and at once the sets are as large, and no set is larger", "[pose_graph]",
                   SE2, SE3) {
  for (std::uint64_t seed = 31; seed < 35; ++seed) {
    Scene<TestType> scene(250, seed);
    scene.fill(50, 150);
    LoopSelection<TestType> selection = selectionFor(scene, 200);
    LoopSelection<TestType> at_once = selectionFor(scene, 200);
    for (const auto& loop : scene.loops) {
      std::uint32_t id = 0;
      REQUIRE(selection.addLoop(loop, kNodes, id).ok());
      REQUIRE(at_once.holdLoop(loop, id).ok());
    }
    at_once.search(kNodes);
    REQUIRE(selection.exact());
    REQUIRE(at_once.exact());
    std::vector<std::uint64_t> set(selection.consistency().words());
    std::vector<std::uint64_t> active(set.size());
    std::uint32_t in_set = 0;
    std::uint32_t in_set_at_once = 0;
    const auto inSet = [](LoopVerdict verdict) {
      return verdict == LoopVerdict::kSelected || verdict == LoopVerdict::kUnsupported ? 1U : 0U;
    };
    for (std::uint32_t k = 0; k < selection.held(); ++k) {
      in_set += inSet(selection.verdict(k));
      in_set_at_once += inSet(at_once.verdict(k));
      if (selection.verdict(k) != LoopVerdict::kAgainstOdometry) setBit(active, k);
    }
    CHECK(in_set == in_set_at_once);
    MaximumClique clique(selection.consistency().capacity());
    const CliqueResult result = clique.search(selection.consistency(), active, 0, 100000, set);
    CHECK(result.exact);
    CHECK(result.size == in_set);
  }
}

TEST_CASE("Without pairwise consistency all that pass the gate are selected", "[pose_graph]") {
  Scene<SE2> scene(250, 5);
  scene.fill(20, 60);
  LoopSelectionSettings settings = loopSelectionSettings<SE2>();
  settings.pairwise = false;
  LoopSelection<SE2> selection = selectionFor(scene, 80, settings);
  std::uint32_t passed = 0;
  for (const auto& loop : scene.loops) {
    std::uint32_t id = 0;
    REQUIRE(selection.addLoop(loop, kNodes, id).ok());
    passed += selection.gate(id).chi_squared <= settings.gate_chi_squared ? 1U : 0U;
  }
  CHECK(selection.selected().size() == passed);
}

TEST_CASE("A full selection lets loops that are not in a set give way, and refuses when all agree",
          "[pose_graph]") {
  Scene<SE3> scene(200, 41);
  for (int k = 0; k < 12; ++k) {
    scene.addTrue();
  }
  for (int k = 0; k < 4; ++k) {
    scene.addFalse(3);
  }
  for (int k = 0; k < 6; ++k) {
    scene.addTrue();
  }
  LoopSelection<SE3> selection = selectionFor(scene, 16);
  std::uint32_t id = 0;
  for (std::size_t k = 0; k < 20; ++k) {
    REQUIRE(selection.addLoop(scene.loops[k], kNodes, id).ok());
  }
  CHECK(selection.held() == 16);
  CHECK(selection.counters().replaced == 4);
  CHECK(selection.selected().size() == 16);
  const auto before = copyOf(selection.selected());
  CHECK(selection.addLoop(scene.loops[20], kNodes, id).code == StatusCode::kCapacityReached);
  CHECK(copyOf(selection.selected()) == before);
  CHECK(selection.counters().refused == 1);
}

TEST_CASE("Bad loops are refused", "[pose_graph]") {
  Scene<SE2> scene(50, 3);
  LoopSelection<SE2> selection = selectionFor(scene, 4);
  scene.addTrue();
  std::uint32_t id = 0;
  RelativePose<SE2> loop = scene.loops[0];
  loop.to = 50;
  CHECK(selection.addLoop(loop, kNodes, id).code == StatusCode::kInvalidInput);
  loop = scene.loops[0];
  loop.T_from_to.translation.x() = std::nan("");
  CHECK(selection.addLoop(loop, kNodes, id).code == StatusCode::kInvalidInput);
  loop = scene.loops[0];
  loop.information.setZero();
  CHECK(selection.addLoop(loop, kNodes, id).code == StatusCode::kInvalidInput);
  loop = scene.loops[0];
  loop.to = loop.from;
  CHECK(selection.addLoop(loop, kNodes, id).code == StatusCode::kInvalidInput);
  CHECK(selection.held() == 0);
  CHECK(selection.counters().refused == 4);
}

TEST_CASE("Components are tied by enough loops that agree, and by no fewer", "[pose_graph]") {
  Scene<SE3> scene(120, 51);
  const LoopSelectionSettings settings = loopSelectionSettings<SE3>();
  LoopSelection<SE3> selection({120, 20}, settings);
  for (std::uint32_t k = 0; k < 120; ++k) {
    (void)(k % 60 == 0
               ? selection.odometry().beginComponent()
               : selection.odometry().append(scene.chain.odometry.relative(k - 1, k), stepCovariance<SE3>()));
  }
  std::uint32_t id = 0;
  const auto add = [&](std::uint32_t from, std::uint32_t to, double off) {
    RelativePose<SE3> loop = scene.chain.loop(from, to, loopCovariance<SE3>(), scene.random);
    loop.T_from_to.translation.x() += off;
    REQUIRE(selection.addLoop(loop, kNodes, id).ok());
  };
  add(5, 70, 0);
  add(9, 75, 40);  // metres: nothing but the other loops contradicts it
  add(80, 12, 0);
  CHECK(selection.selected().empty());
  CHECK(selection.verdict(0) == LoopVerdict::kUnsupported);
  add(20, 85, 0);
  add(24, 90, 0);
  add(28, 94, 0);
  CHECK(selection.selected().empty());  // five beside one: as a fair coin falls in one of five throws
  add(33, 99, 0);
  CHECK(copyOf(selection.selected()) == std::vector<std::uint32_t>{0, 2, 3, 4, 5, 6});
  CHECK(selection.verdict(1) == LoopVerdict::kInconsistent);
  // Loops within a component are a matter of their own.
  add(10, 40, 0);
  CHECK(selection.verdict(id) == LoopVerdict::kSelected);
  CHECK(selection.selected().size() == 7);
  // Five that agree on another place leave it open which is right.
  const SE3 twin(Eigen::Quaterniond::Identity(), Eigen::Vector3d(40, 0, 0));
  for (const std::uint32_t k : {11U, 16U, 21U, 26U, 31U}) {
    RelativePose<SE3> loop = scene.chain.loop(k, 66 + k, loopCovariance<SE3>(), scene.random);
    const SE3& P = selection.odometry().pose(k);
    loop.T_from_to = P.inverse() * twin * P * loop.T_from_to;
    REQUIRE(selection.addLoop(loop, kNodes, id).ok());
  }
  CHECK(copyOf(selection.selected()) == std::vector<std::uint32_t>{7});
}

TEST_CASE("A loop rejected early is taken once support arrives", "[pose_graph]") {
  Random random(72);
  const PoseMatrix<SE2> vague = testCovariance<SE2>(0.05, 0.1);
  const SimulatedChain<SE2> chain(200, vague, random);
  LoopSelection<SE2> selection({200, 10}, loopSelectionSettings<SE2>());
  (void)selection.odometry().beginComponent();
  for (std::uint32_t k = 1; k < 200; ++k) {
    (void)selection.odometry().append(chain.odometry.relative(k - 1, k), vague);
  }
  const PoseMatrix<SE2> noise = testCovariance<SE2>(1e-2, 1e-2);
  std::uint32_t id = 0;
  // A false loop that came first holds the set: the true one that contradicts it is not in it.
  RelativePose<SE2> wrong = chain.loop(60, 189, noise, random);
  wrong.T_from_to.translation.y() += 4;
  REQUIRE(selection.addLoop(wrong, kNodes, id).ok());
  REQUIRE(selection.addLoop(chain.loop(60, 190, noise, random), kNodes, id).ok());
  CHECK(selection.verdict(0) == LoopVerdict::kUnsupported);
  CHECK(selection.verdict(1) == LoopVerdict::kInconsistent);
  CHECK(selection.selected().empty());
  // One more that agrees with the second makes the larger set, and both are taken.
  REQUIRE(selection.addLoop(chain.loop(60, 191, noise, random), kNodes, id).ok());
  CHECK(copyOf(selection.selected()) == std::vector<std::uint32_t>{1, 2});
  CHECK(selection.verdict(0) == LoopVerdict::kInconsistent);
  const std::uint64_t tests = selection.counters().pair_tests;
  CHECK(tests == 3);  // each pair once: what was found of the early ones is kept
}

TEST_CASE("Where the odometry is vague, a loop that nothing supports is not selected", "[pose_graph]") {
  // The heading is lost: every loop agrees with the chain.
  Random random(71);
  const PoseMatrix<SE2> vague = testCovariance<SE2>(0.05, 0.1);
  const SimulatedChain<SE2> chain(200, vague, random);
  LoopSelection<SE2> selection({200, 10}, loopSelectionSettings<SE2>());
  (void)selection.odometry().beginComponent();
  for (std::uint32_t k = 1; k < 200; ++k) {
    (void)selection.odometry().append(chain.odometry.relative(k - 1, k), vague);
  }
  const PoseMatrix<SE2> noise = testCovariance<SE2>(1e-2, 1e-2);
  std::uint32_t id = 0;
  RelativePose<SE2> alone = chain.loop(5, 150, noise, random);
  alone.T_from_to.translation.x() += 3;
  REQUIRE(selection.addLoop(alone, kNodes, id).ok());
  CHECK(selection.verdict(id) == LoopVerdict::kUnsupported);
  // Two loops of which both ends are neighbours vouch for each other.
  REQUIRE(selection.addLoop(chain.loop(60, 190, noise, random), kNodes, id).ok());
  REQUIRE(selection.addLoop(chain.loop(60, 191, noise, random), kNodes, id).ok());
  CHECK(copyOf(selection.selected()) == std::vector<std::uint32_t>{1, 2});
}

}  // namespace
}  // namespace swiftlet
