// The fixed-lag smoother on simulated flights: accuracy, what it must not claim to know, covariances,
// repeatability.

#include "estimator/smoother/smoother.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "estimator/geometry/so3.hpp"
#include "tests/smoother/smoother_run.hpp"

using namespace swiftlet;
using test::SmootherRun;
using test::TrackFlight;

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

struct Step {
  BodyState x;
  Matrix15d covariance;
};

std::vector<Step> run(const TrackFlight& flight, const SmootherSettings& settings, int iterations = 3) {
  SmootherRun smoother(flight, settings);
  std::vector<Step> steps;
  flight.play([&](const ImuSample& s) { smoother.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(smoother.step(k, iterations).ok());
                steps.push_back({smoother.smoother().newest().x, smoother.smoother().covariance()});
              });
  return steps;
}

double positionRms(const TrackFlight& flight, const std::vector<Step>& steps) {
  double sum = 0;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    sum += (steps[k].x.T_world_body.translation - flight.truth(k).T_world_body.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(steps.size()));
}

double smallestEigenvalue(const Matrix6d& m) {
  return Eigen::SelfAdjointEigenSolver<Matrix6d>(m, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

// Symmetric to rounding: covariances differ by ten orders between their blocks.
bool isPositive(const Matrix15d& P) { return Eigen::LLT<Matrix15d>(P).info() == Eigen::Success; }

}  // namespace

TEST_CASE("Smoother: a flight of 20 s stays near the truth, its errors within its sigmas", "[smoother]") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const TrackFlight flight(test::roomFlight(20, seed));
    const std::vector<Step> steps = run(flight, test::settingsFor(flight));
    const double rms = positionRms(flight, steps);
    std::printf("smoother, seed %d: %.4f m RMS in the start's frame\n", static_cast<int>(seed), rms);
    CHECK(rms < 0.05);
  }
}

TEST_CASE("Smoother: errors of pose, velocity and biases are as large as the covariance says", "[smoother]") {
  // The last state of each flight: one independent sample. Start errors are drawn from the start's sigmas.
  constexpr int kFlights = 12;
  double pose = 0;
  double motion = 0;
  for (std::uint64_t seed = 31; seed < 31 + kFlights; ++seed) {
    const TrackFlight flight(test::roomFlight(6, seed));
    const std::vector<Step> steps = run(flight, test::settingsFor(flight));
    const Vector15d error = flight.truth(steps.size() - 1).minus(steps.back().x);
    const Matrix15d& P = steps.back().covariance;
    pose += error.head<6>().dot(P.topLeftCorner<6, 6>().llt().solve(error.head<6>())) / kFlights;
    motion += error.tail<9>().dot(P.bottomRightCorner<9, 9>().llt().solve(error.tail<9>())) / kFlights;
  }
  std::printf("smoother: NEES of %d flights' last states: pose %.2f (6), velocity and biases %.2f (9)\n",
              kFlights, pose, motion);
  // The sums are chi-square with 72 and 108 degrees of freedom: 0.1 % and 99.9 %.
  CHECK(pose > 40.4 / kFlights);
  CHECK(pose < 114.8 / kFlights);
  CHECK(motion > 68.1 / kFlights);
  CHECK(motion < 159.2 / kFlights);
}

TEST_CASE("Smoother: nothing is learned of position and yaw after the start", "[smoother][observability]") {
  // A lively flight: linearization points move most where the motion is fast.
  SimulationSettings settings = test::roomFlight(30, 2);
  settings.flight.aggressiveness = 1.6;
  const TrackFlight flight(settings);
  const std::vector<Step> steps = run(flight, test::settingsFor(flight));
  // n^T P^-1 n, the marginal's information along a direction that only the start knows, can only fall:
  // it is the start's less what was lost since. (With Schur complements of a system H N = 0 plus the
  // start's G: n^T P^-1 n = n0^T G n0 - n0^T G M^-1 G n0.)
  Eigen::Vector4d lowest = Eigen::Vector4d::Constant(1e30);
  Eigen::Vector4d first;
  Eigen::Vector4d last;
  double worst_rise = 0;
  for (std::size_t k = 1; k < steps.size(); ++k) {
    const Eigen::Matrix<double, kStateDim, 4> N = test::unobservable(steps[k].x);
    const Eigen::Vector4d information = (N.transpose() * steps[k].covariance.llt().solve(N)).diagonal();
    for (int axis = 0; axis < 4; ++axis) {
      worst_rise = std::max(worst_rise, information[axis] / lowest[axis] - 1);
      lowest[axis] = std::min(lowest[axis], information[axis]);
    }
    if (k == 1) first = information;
    last = information;
  }
  std::printf(
      "information of x, y, z, yaw: after the first interval %.3g %.3g %.3g %.3g, after 30 s "
      "%.3g %.3g %.3g %.3g; largest rise %.2g\n",
      first[0], first[1], first[2], first[3], last[0], last[1], last[2], last[3], worst_rise);
  // A landmark found again restores a little of what was lost. Sloppy linearization teaches far more.
  CHECK(worst_rise < 0.05);
  for (int axis = 0; axis < 4; ++axis) CHECK(last[axis] < 0.5 * first[axis]);
}

TEST_CASE("Smoother: a turned and shifted world gives the same flight, turned and shifted", "[smoother]") {
  // Nothing may depend on where the origin is or which way it faces.
  SimulationSettings settings = test::roomFlight(6, 3);
  const TrackFlight flight(settings);
  const SE3 T(Eigen::Quaterniond(Eigen::AngleAxisd(2.1, Eigen::Vector3d::UnitZ())), {30, -20, 5});
  std::vector<BodyState> plain;
  std::vector<BodyState> moved;
  std::vector<int> plain_iterations;
  std::vector<int> moved_iterations;
  for (const bool turned : {false, true}) {
    Smoother smoother(flight.rig(), flight.noise(), test::settingsFor(flight));
    FixedVector<KeyframeState, kMaxStates> left;
    StartState start;
    start.state = flight.truth(0);
    start.velocity_sigma = 0.1;
    if (turned) {
      start.state.T_world_body = T * start.state.T_world_body;
      start.state.v_world_body = T.rotation * start.state.v_world_body;
    }
    smoother.start(start);
    flight.play([&](const ImuSample& s) { smoother.addImu(s); },
                [&](std::size_t k) {
                  Smoother::StepInput input;
                  input.frame = &flight.frames()[k];
                  REQUIRE(smoother.step(input).ok());
                  smoother.trim(left);
                  (turned ? moved : plain).push_back(smoother.newest().x);
                  (turned ? moved_iterations : plain_iterations).push_back(smoother.statistics().iterations);
                });
  }
  // One step more or less moves a state by up to the size of step at which the iteration ends, 1e-4.
  CHECK(plain_iterations == moved_iterations);
  CHECK(std::count(plain_iterations.begin(), plain_iterations.end(), 3) <
        static_cast<std::ptrdiff_t>(plain_iterations.size()));  // the early end does take part
  for (std::size_t k = 0; k < plain.size(); ++k) {
    const SE3 expected = T * plain[k].T_world_body;
    REQUIRE((moved[k].T_world_body.translation - expected.translation).norm() < 1e-5);
    REQUIRE(moved[k].T_world_body.rotation.angularDistance(expected.rotation) < 1e-5);
  }
}

TEST_CASE("Smoother: covariances are positive, relative ones far smaller than absolute", "[smoother]") {
  const TrackFlight flight(test::roomFlight(20, 6));
  SmootherRun smoother(flight);
  double relative_sum = 0;
  double absolute_sum = 0;
  double nees = 0;
  int pairs = 0;
  const auto check = [&](std::size_t k) {
    REQUIRE(smoother.step(k).ok());
    REQUIRE(isPositive(smoother.smoother().covariance()));
    if (k < 100 || k % 10 != 0) return;
    auto window = std::make_unique<SmoothedWindow>();
    smoother.smoother().window(*window);
    const std::size_t newest = window->poses.size() - 1;
    const Matrix6d absolute = smoother.smoother().covariance().topLeftCorner<6, 6>();
    for (std::size_t i = 0; i < newest; ++i) {
      Matrix6d relative;
      if (!smoother.smoother().relativeCovariance(i, newest, relative)) continue;
      CHECK((relative - relative.transpose()).norm() < 1e-9 * relative.norm());
      CHECK(smallestEigenvalue(relative) > 0);
      if (i + 1 != newest) continue;
      relative_sum += relative.bottomRightCorner<3, 3>().trace();
      absolute_sum += absolute.bottomRightCorner<3, 3>().trace();
      const WindowPose& a = window->poses[i];
      const WindowPose& b = window->poses[newest];
      const SE3 estimate = a.T_world_body.inverse() * b.T_world_body;
      const SE3 truth =
          flight.truth(a.frame_index).T_world_body.inverse() * flight.truth(b.frame_index).T_world_body;
      Vector6d error;
      error << logSo3(estimate.rotation.conjugate() * truth.rotation),
          truth.translation - estimate.translation;
      nees += error.dot(relative.llt().solve(error));
      ++pairs;
    }
    // A pose relative to itself is certain.
    Matrix6d none;
    REQUIRE(smoother.smoother().relativeCovariance(newest, newest, none));
    CHECK(none.norm() < 1e-9 * absolute.norm());
  };
  flight.play([&](const ImuSample& s) { smoother.addImu(s); }, check);
  REQUIRE(pairs > 20);
  std::printf("neighbouring poses: %.2g m against %.2g m absolute; NEES %.2f over %d pairs\n",
              std::sqrt(relative_sum / pairs), std::sqrt(absolute_sum / pairs), nees / pairs, pairs);
  CHECK(relative_sum < 0.1 * absolute_sum);
  // chi-square(6) over 25 or more pairs, nearly independent: sigma at most 0.7.
  CHECK(nees / pairs > 3.5);
  CHECK(nees / pairs < 9.5);
}

TEST_CASE("Smoother: the same input gives the same bytes", "[smoother]") {
  const TrackFlight flight(test::roomFlight(8, 7));
  const std::vector<Step> a = run(flight, test::settingsFor(flight));
  const std::vector<Step> b = run(flight, test::settingsFor(flight));
  REQUIRE(a.size() == b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    REQUIRE(a[k].x.T_world_body.rotation.coeffs() == b[k].x.T_world_body.rotation.coeffs());
    REQUIRE(a[k].x.T_world_body.translation == b[k].x.T_world_body.translation);
    REQUIRE(a[k].x.v_world_body == b[k].x.v_world_body);
    REQUIRE(a[k].x.bias_gyro == b[k].x.bias_gyro);
    REQUIRE(a[k].x.bias_accel == b[k].x.bias_accel);
    REQUIRE(a[k].covariance == b[k].covariance);
  }
}

TEST_CASE("Smoother: a reset forgets", "[smoother]") {
  const TrackFlight flight(test::roomFlight(4, 8));
  SmootherRun smoother(flight);
  flight.play([&](const ImuSample& s) { smoother.addImu(s); },
              [&](std::size_t k) {
                const Status status = smoother.step(k);
                INFO("frame " << k << ": " << status.what);
                REQUIRE(status.ok());
                if (k != 30) return;
                smoother.smoother().reset();
                CHECK_FALSE(smoother.smoother().started());
                Smoother::StepInput input;
                input.frame = &flight.frames()[k];
                CHECK(smoother.smoother().step(input).code == StatusCode::kNotReady);
              });
  const std::size_t last = flight.frames().size() - 1;
  CHECK(
      (smoother.smoother().newest().x.T_world_body.translation - flight.truth(last).T_world_body.translation)
          .norm() < 0.05);
}

TEST_CASE("Smoother: every keyframe leaves once, in its own time, with a covariance", "[smoother]") {
  const TrackFlight flight(test::roomFlight(12, 9));
  SmootherRun smoother(flight);
  std::vector<Stamp> left;
  std::size_t keyframes = 0;
  const auto take = [&](const FixedVector<KeyframeState, kMaxStates>& states) {
    for (const KeyframeState& s : states) {
      left.push_back(s.state.stamp);
      CHECK(isPositive(s.state.covariance));
    }
  };
  flight.play([&](const ImuSample& s) { smoother.addImu(s); },
              [&](std::size_t k) {
                REQUIRE(smoother.step(k).ok());
                keyframes += flight.frames()[k].keyframe || k == 0 ? 1 : 0;
                take(smoother.left());
              });
  FixedVector<KeyframeState, kMaxStates> rest;
  smoother.smoother().flush(rest);
  take(rest);
  CHECK(left.size() == keyframes);
  std::sort(left.begin(), left.end());
  CHECK(std::adjacent_find(left.begin(), left.end()) == left.end());
}

TEST_CASE("Smoother: no state outlives the horizon", "[smoother]") {
  const TrackFlight flight(test::roomFlight(10, 10));
  for (const double horizon : {1.0, 2.5}) {
    SmootherSettings settings = test::settingsFor(flight);
    settings.horizon = horizon;
    SmootherRun smoother(flight, settings);
    auto window = std::make_unique<SmoothedWindow>();
    double oldest = 0;
    flight.play([&](const ImuSample& s) { smoother.addImu(s); },
                [&](std::size_t k) {
                  REQUIRE(smoother.step(k).ok());
                  smoother.smoother().window(*window);
                  const Stamp now = flight.frames()[k].stamp;
                  oldest = std::max(oldest, (now - window->poses[0].stamp).seconds());
                });
    INFO("horizon " << horizon << " s, oldest state " << oldest << " s");
    CHECK(oldest <= horizon + 1e-6);
  }
}
