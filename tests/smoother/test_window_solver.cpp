// Gauss-Newton on hand-made windows: every step is checked against the cost, the last one too.

#include "estimator/smoother/window_solver.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "tests/smoother/window_scene.hpp"

using namespace swiftlet;
using test::WindowScene;

namespace {

constexpr std::size_t kStates = 6;
constexpr std::size_t kLandmarks = 60;
constexpr double kInterval = 0.5;  // s
constexpr double kAstray = 3.0;    // m: steps from so far away are far from linear
constexpr double kAllowed = 1.02;  // a step may raise the cost by so much before it is taken back

/// States somewhere near the truth, with what they saw of some landmarks. The newest saw nothing, so that no
/// sighting is left out on the way.
struct Scene {
  std::unique_ptr<WindowProblem> problem;
  std::unique_ptr<NormalEquations> system = std::make_unique<NormalEquations>();
  std::unique_ptr<WindowCovariance> covariance = std::make_unique<WindowCovariance>();
  WindowSolver solver;
  FrameStatistics statistics;
  std::vector<std::vector<Sighting>> sightings;  // as given, by landmark

  /// `astray`: sigma of the poses' error, m and, a third of it, rad.
  Scene(std::uint64_t seed, double astray) {
    Random random(seed, 21);
    const Rig rig = makeRig(RigKind::kEuroc).rig;
    const WindowScene truth = test::sceneAround(rig, kStates, 0.5, random);
    problem = std::make_unique<WindowProblem>(rig, ImuNoise{}, false, false, false);
    for (std::size_t k = 0; k <= kStates; ++k) {
      WindowState& state = problem->window.inSlot(problem->window.add());
      state.x = truth.states[std::min(k, kStates - 1)];
      state.keyframe = true;
      if (k == 0) {
        StartState start;
        start.state = state.x;
        problem->startPrior(start);
        continue;
      }
      state.link = LinkKind::kConstantVelocity;
      state.link_duration = kInterval;
      SE3& T = state.x.T_world_body;
      T.rotation = (T.rotation * expSo3(test::randomVector(random, astray / 3))).normalized();
      T.translation += test::randomVector(random, astray);
    }
    for (std::size_t l = 0; l < kLandmarks; ++l) {
      const Eigen::Vector3d p = truth.inSight(rig, random.uniform(2, 8), random);
      sightings.push_back(truth.sightings(rig, p, 1.0, 1.0, random));
      Landmark& landmark = problem->landmarks.add(l);
      for (const Sighting& sighting : sightings.back()) landmark.sightings.pushBack(sighting);
    }
  }

  void solve(int iterations) {
    REQUIRE(solver.solve(*problem, *system, *covariance, iterations, 0, statistics).ok());
  }

  [[nodiscard]] bool has(std::size_t l) const { return problem->landmarks[l].in_system; }

  /// By the scalar functions, over everything that was given of the landmarks that `other` has too.
  [[nodiscard]] double costWith(const Scene& other) {
    problem->placeCameras();
    double sum = 0;
    for (std::size_t l = 0; l < kLandmarks; ++l) {
      if (!has(l) || !other.has(l)) continue;
      const LandmarkPoint& point = problem->landmarks[l].point;
      for (const Sighting& sighting : sightings[l]) {
        for (std::size_t c = 0; c < kMaxCameras; ++c) {
          Eigen::Vector2d r;
          if (!sighting.camera[c].used) continue;
          if (!reprojectionResidual(sighting.camera[c], problem->rig_poses[sighting.slot].current[c], point,
                                    r)) {
            continue;
          }
          sum += RobustWeight::cauchy(r.squaredNorm()).cost;
        }
      }
    }
    const Window& window = problem->window;
    for (std::size_t k = 1; k < window.size(); ++k) {
      MotionFactor factor;
      REQUIRE(constantVelocityFactor(kInterval, problem->noise, window[k - 1].x, window[k].x, factor));
      sum += 0.5 * factor.residual.squaredNorm();
    }
    const Vector15d d = window[0].x.minus(problem->prior.blocks()[0].reference);
    return sum + 0.5 * d.dot(problem->prior.H() * d);
  }
};

}  // namespace

TEST_CASE("Window solver: the last step is taken back when it raises the cost", "[window_solver]") {
  int taken_back = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    for (int last = 3; last <= 5; ++last) {
      Scene before(seed, kAstray);
      before.solve(last - 1);
      Scene after(seed, kAstray);
      after.solve(last);
      INFO("seed " << seed << ", step " << last);
      CHECK(after.costWith(before) < kAllowed * before.costWith(after));
      const bool same = after.problem->window[kStates - 1].x.T_world_body.translation ==
                        before.problem->window[kStates - 1].x.T_world_body.translation;
      taken_back += same && before.statistics.iterations == last - 1 && after.statistics.iterations == last;
    }
  }
  // Some of the steps from so far away do raise it: otherwise nothing was asked.
  std::printf("window solver: %d of 120 last steps were taken back\n", taken_back);
  CHECK(taken_back >= 5);
}

TEST_CASE("Window solver: a single step does not raise the cost either", "[window_solver]") {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Scene before(seed, kAstray);
    before.problem->placeCameras();
    for (Landmark& landmark : before.problem->landmarks) {
      landmark.in_system = triangulate(before.problem->rig_poses, landmark.views(), 6, landmark.point);
    }
    Scene after(seed, kAstray);
    after.solve(1);
    INFO("seed " << seed);
    CHECK(after.costWith(before) < kAllowed * before.costWith(after));
  }
}

TEST_CASE("Window solver: the cost alone is that of the system", "[window_solver]") {
  Scene scene(3, 0.02);
  WindowProblem& problem = *scene.problem;
  scene.solve(2);
  problem.window[2].rest = problem.window[3].rest = 1;
  const std::size_t n = problem.window.size();
  problem.window[n - 1].rest = 1;
  problem.placeCameras();
  problem.assignOffsets();
  NormalEquations& system = *scene.system;
  system.begin(problem.calibration.layout(), problem.dimension);
  std::vector<double> work(kMaxSystemDim);
  const double prior = addPrior(problem, system, work);
  for (std::size_t k = 1; k < n; ++k) addMotion(problem, k, system);
  int landmarks = 0;
  for (const Landmark& landmark : problem.landmarks) {
    if (!landmark.in_system) continue;
    REQUIRE(system.addLandmark(problem.viewsOf(landmark.views()), landmark.point, problem.window.slots(),
                               nullptr));
    ++landmarks;
  }
  CHECK(landmarks > 50);
  const WindowCost cost = costOf(problem, work);
  CHECK(cost.prior == Approx(prior).epsilon(1e-12));
  CHECK(cost.factors == Approx(system.cost()).epsilon(1e-12));
}

TEST_CASE("Window solver: rest factors are the derivatives of their cost", "[window_solver][rest]") {
  Scene scene(4, 0.001);
  WindowProblem& problem = *scene.problem;
  problem.assignOffsets();
  // The only pair at rest: two states nearly at one place, of which the second moves.
  WindowState& i = problem.window[2];
  WindowState& j = problem.window[3];
  j.x.T_world_body = i.x.T_world_body * SE3(expSo3(Eigen::Vector3d(1e-4, -2e-4, 3e-4)), {2e-4, -1e-4, 3e-4});
  j.x.v_world_body = {0.01, -0.02, 0.015};
  const auto gradientAndInformation = [&](Eigen::VectorXd& g, Eigen::MatrixXd& H) {
    scene.system->begin(problem.calibration.layout(), problem.dimension);
    addMotion(problem, 3, *scene.system);
    g = scene.system->g();
    H = scene.system->H().selfadjointView<Eigen::Lower>();
    return scene.system->cost();
  };
  Eigen::VectorXd g_without, g;
  Eigen::MatrixXd H_without, H;
  const double cost_without = gradientAndInformation(g_without, H_without);
  i.rest = j.rest = 1;
  const double cost = gradientAndInformation(g, H);
  const Eigen::VectorXd gradient = g - g_without;
  const Eigen::MatrixXd information = H - H_without;
  // 0.01 m/s, 0.3 mm and 0.35 mrad: so many sigmas squared.
  const double expected = 0.5 * (j.x.v_world_body.squaredNorm() / (0.01 * 0.01) + 14e-8 / (3e-4 * 3e-4) +
                                 14e-8 / (3.5e-4 * 3.5e-4));
  CHECK(cost - cost_without == Approx(expected).epsilon(1e-6));
  const auto costAt = [&](const WindowState& state, int column, double step) {
    WindowState& moved = problem.window[&state == &i ? 2 : 3];
    const BodyState before = moved.x;
    Vector15d delta = Vector15d::Zero();
    delta[column] = step;
    moved.x.retract(delta);
    Eigen::VectorXd unused_g;
    Eigen::MatrixXd unused_H;
    double change = gradientAndInformation(unused_g, unused_H);
    i.rest = j.rest = 0;
    change -= gradientAndInformation(unused_g, unused_H);
    i.rest = j.rest = 1;
    moved.x = before;
    return change;
  };
  for (const WindowState* const state : {&i, &j}) {
    for (int column = 0; column < 9; ++column) {
      INFO("state " << (state == &i ? "i" : "j") << ", column " << column);
      constexpr double kStep = 1e-5;
      const double up = costAt(*state, column, kStep);
      const double down = costAt(*state, column, -kStep);
      const double at = cost - cost_without;
      const double scale = column < 6 ? 1 / 3e-4 : 1 / 0.01;
      CHECK(gradient[state->offset + column] == Approx((up - down) / (2 * kStep)).margin(2e-3 * scale));
      CHECK(information(state->offset + column, state->offset + column) ==
            Approx((up + down - 2 * at) / (kStep * kStep)).margin(2e-3 * scale * scale));
    }
  }
}

TEST_CASE("Window solver: at rest the solution stands still, without rest it moves on",
          "[window_solver][rest]") {
  // No images: the motion is the start's, 1 m/s, unless rest says otherwise.
  const auto spread = [](std::uint32_t rest) {
    Scene scene(5, 0.0);
    Window& window = scene.problem->window;
    for (std::size_t k = 1; k < window.size(); ++k) {
      window[k].x = window[1].x;
      window[k].rest = rest;
    }
    for (std::size_t l = 0; l < kLandmarks; ++l) scene.problem->landmarks[l].sightings.clear();
    window[3].x.T_world_body.translation.x() += 0.05;
    window[3].x.v_world_body = {0.2, 0, 0};
    scene.solve(3);
    return std::pair{(window[3].x.T_world_body.translation - window[2].x.T_world_body.translation).norm(),
                     window[3].x.v_world_body.norm()};
  };
  const auto [apart, speed] = spread(1);
  const auto [apart_moving, speed_moving] = spread(0);
  CHECK(apart < 3e-4);
  CHECK(speed < 0.01);
  CHECK(apart_moving + speed_moving > 0.05);
}

TEST_CASE("Window solver: two rests with a nudge between them are no one pose", "[window_solver][rest]") {
  // The frames of the nudge have left: the states are neighbours, 5 degrees apart, and still before and
  // after.
  Scene scene(5, 0.0);
  WindowProblem& problem = *scene.problem;
  WindowState& i = problem.window[2];
  WindowState& j = problem.window[3];
  for (WindowState* const state : {&i, &j}) state->x.v_world_body.setZero();
  j.x.T_world_body = i.x.T_world_body;
  j.x.T_world_body.rotation = i.x.T_world_body.rotation * expSo3(Eigen::Vector3d(0, 0, 5 * M_PI / 180));
  const auto costOf = [&](std::uint32_t first, std::uint32_t second) {
    i.rest = first;
    j.rest = second;
    scene.system->begin(problem.calibration.layout(), problem.dimension);
    addMotion(problem, 3, *scene.system);
    return scene.system->cost();
  };
  problem.placeCameras();
  problem.assignOffsets();
  const double without = costOf(0, 0);
  CHECK(costOf(1, 2) == Approx(without));
  CHECK(costOf(1, 1) > without + 0.5 * 200 * 200);  // what one rest would say of it
}
