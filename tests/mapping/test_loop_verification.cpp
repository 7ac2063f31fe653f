// Verification of a loop candidate on made-up keyframes: solver, Jacobians by their effect, covariance,
// fates.
#include "mapping/place/loop_verification.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <memory>

#include "mapping/place/three_point_pose.hpp"
#include "tests/mapping/loop_scene.hpp"

using namespace swiftlet;              // NOLINT(google-build-using-namespace)
using namespace swiftlet::loop_scene;  // NOLINT(google-build-using-namespace)

TEST_CASE("three points and their bearings give the pose among at most four") {
  Random random(3);
  int hits = 0;
  for (int n = 0; n < 500; ++n) {
    const SE3 T_a_b(expSo3(randomVector(random)), randomVector(random));
    std::array<Eigen::Vector3d, 3> points;
    std::array<Eigen::Vector3d, 3> bearings;
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d p = randomVector(random) + Eigen::Vector3d(0, 0, 4);
      bearings[i] = p.normalized();
      points[i] = T_a_b * p;
    }
    double best = 1e9;
    for (const SE3& T : poseFromThreePoints(points, bearings))
      best = std::min(best, poseError(T, T_a_b).norm());
    if (best < 1e-5) ++hits;
  }
  INFO(hits);
  // Double roots are lost now and then.
  CHECK(hits >= 490);
  CHECK(poseFromThreePoints({Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(0, 0, 3)},
                            {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()})
            .empty());
}

namespace {

MatchedPoints exactPoints(const SE3& T_old_new, Random& random, int count) {
  MatchedPoints points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p_new = randomVector(random) + Eigen::Vector3d(0, 0, 5);
    const Eigen::Vector3d p_old = T_old_new * p_new;
    MatchedPoint m;
    m.old_view = {p_old.normalized(), 1e-3, 1.0 / p_old.norm(), i % 3 == 0 ? 0.0 : 0.01};
    m.new_view = {p_new.normalized(), 1.5e-3, 1.0 / p_new.norm(), i % 3 == 1 ? 0.0 : 0.02};
    (void)points.tryPushBack(m);
  }
  return points;
}

}  // namespace

TEST_CASE("refinement comes back to the exact pose") {
  Random random(5);
  for (int n = 0; n < 20; ++n) {
    const SE3 truth(expSo3(0.4 * randomVector(random)), randomVector(random));
    MatchedPoints points = exactPoints(truth, random, 30);
    SE3 T(truth.rotation * expSo3(0.03 * randomVector(random)),
          truth.translation + 0.1 * randomVector(random));
    RelativePoseFit fit;
    REQUIRE(refineRelativePose({.steps = 20}, {points.data(), points.size()}, T, fit).ok());
    CHECK(poseError(T, truth).norm() < 1e-5);
    CHECK(fit.used == 30);
  }
}

TEST_CASE("the information is the curvature of the cost") {
  Random random(6);
  const SE3 truth(expSo3(0.4 * randomVector(random)), randomVector(random));
  MatchedPoints points = exactPoints(truth, random, 40);
  const std::span<MatchedPoint> all(points.data(), points.size());
  SE3 T = truth;
  RelativePoseFit fit;
  REQUIRE(refineRelativePose({}, all, T, fit).ok());
  const auto cost = [&](const Vector6d& d) {
    placePoints(SE3(T.rotation * expSo3(d.head<3>()), T.translation + T.rotation * d.tail<3>()), all);
    double sum = 0;
    for (const MatchedPoint& m : points) sum += m.chi_squared;
    return sum;
  };
  constexpr double kStep = 1e-4;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      const Vector6d a = kStep * Vector6d::Unit(i);
      const Vector6d b = kStep * Vector6d::Unit(j);
      const double second = (cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b)) / (4 * kStep * kStep);
      const double scale = std::sqrt(fit.information(i, i) * fit.information(j, j));
      CHECK(0.5 * second == Approx(fit.information(i, j)).margin(2e-3 * scale));
    }
  }
}

TEST_CASE("the body's covariance is the cameras' carried over") {
  Random random(8);
  const SE3 X(expSo3(randomVector(random)), randomVector(random));
  const SE3 T_cam(expSo3(randomVector(random)), randomVector(random));
  // By its effect on one perturbation: covariance d d^T.
  const Vector6d d = 1e-6 * Vector6d::Random();
  const SE3 moved(T_cam.rotation * expSo3(d.head<3>()), T_cam.translation + T_cam.rotation * d.tail<3>());
  const Vector6d body = poseError(X * T_cam * X.inverse(), X * moved * X.inverse());
  CHECK((covarianceOfBody(X, d * d.transpose()) - body * body.transpose()).norm() < 1e-16);
}

namespace {

LoopVerification verifyScene(LoopVerifier& verifier, const Scene& scene) {
  LoopVerification result;
  REQUIRE(verifier.verify(scene.old_keyframe, scene.new_keyframe, {}, 1.0, result).ok());
  return result;
}

struct Statistics {
  int accepted = 0;
  double nees = 0;
};

Statistics runScenes(const SceneSettings& settings, int runs,
                     const LoopVerificationSettings& verification = {}) {
  const auto verifier = std::make_unique<LoopVerifier>(makeRig(), verification);
  Statistics statistics;
  for (int n = 0; n < runs; ++n) {
    const Scene scene = makeScene(settings, static_cast<std::uint64_t>(n) + 1);
    const LoopVerification result = verifyScene(*verifier, scene);
    if (!result.accepted()) continue;
    ++statistics.accepted;
    const Vector6d e = poseError(result.T_old_new, scene.T_old_new);
    statistics.nees += e.dot(result.covariance.ldlt().solve(e));
  }
  statistics.nees /= std::max(statistics.accepted, 1);
  return statistics;
}

}  // namespace

TEST_CASE("the covariance is honest over many scenes") {
  SceneSettings settings;
  settings.twins = 0.3;
  const Statistics stereo = runScenes(settings, 200);
  settings.depth_share = 0.4;
  const Statistics sparse = runScenes(settings, 200);
  settings.depth_share = 1.0;
  settings.pixel_noise = 1.6;
  settings.disparity_noise = 0.7;
  const Statistics noisy = runScenes(settings, 100);
  WARN("NEES (6 wanted) with all depths "
       << stereo.nees << " of " << stereo.accepted << ", with 40 % " << sparse.nees << " of "
       << sparse.accepted << ", at twice the noise " << noisy.nees << " of " << noisy.accepted);
  CHECK(stereo.accepted >= 190);
  CHECK(stereo.nees == Approx(6).margin(1.0));
  CHECK(sparse.accepted >= 180);
  CHECK(sparse.nees == Approx(6).margin(1.2));
  CHECK(noisy.nees < 10);
}

namespace {

LoopFate fateOf(const SceneSettings& scene, const LoopVerificationSettings& settings = {},
                std::uint64_t seed = 3) {
  const auto verifier = std::make_unique<LoopVerifier>(makeRig(), settings);
  return verifyScene(*verifier, makeScene(scene, seed)).fate;
}

}  // namespace

TEST_CASE("each candidate's fate says where it ended") {
  CHECK(fateOf({}) == LoopFate::kAccepted);
  SceneSettings unlike;
  unlike.common = 5;
  CHECK(fateOf(unlike) == LoopFate::kTooFewMatches);
  SceneSettings blind;
  blind.depth_share = 0;
  CHECK(fateOf(blind) == LoopFate::kTooFewDepths);
  SceneSettings chance;
  chance.common = 0;
  chance.twins = 0.6;
  CHECK(fateOf(chance) == LoopFate::kNoConsensus);
  SceneSettings drowned;
  drowned.common = 30;
  drowned.alone = 250;
  drowned.twins = 0.9;
  CHECK(fateOf(drowned) == LoopFate::kLowShare);
  LoopVerificationSettings strict;
  strict.min_inliers = 400;
  CHECK(fateOf({}, strict) == LoopFate::kTooFewInliers);
  strict = {};
  strict.min_spread = strict.min_spread_of_many = 0.8;
  CHECK(fateOf({}, strict) == LoopFate::kPoorSpread);
  strict = {};
  strict.max_chi_squared_per_dof = 0.1;
  CHECK(fateOf({}, strict) == LoopFate::kPoorFit);
  strict = {};
  strict.max_rotation_sigma = 1e-5;
  CHECK(fateOf({}, strict) == LoopFate::kIllConditioned);
  strict = {};
  strict.max_distance = 0.1;
  CHECK(fateOf({}, strict) == LoopFate::kTooFar);
  strict = {};
  strict.max_rotation_shift = 1e-6;
  CHECK(fateOf({}, strict) == LoopFate::kFragile);
  for (std::size_t i = 0; i < kLoopFates; ++i) CHECK(std::strlen(describe(static_cast<LoopFate>(i))) > 3);
}

TEST_CASE("chance matches are never a loop") {
  const auto verifier = std::make_unique<LoopVerifier>(makeRig());
  SceneSettings settings;
  settings.common = 0;
  settings.alone = 200;
  settings.twins = 0.8;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    CHECK_FALSE(verifyScene(*verifier, makeScene(settings, seed)).accepted());
  }
}

TEST_CASE("input that is not finite and settings out of range are refused") {
  const auto verifier = std::make_unique<LoopVerifier>(makeRig());
  const Scene good = makeScene({}, 1);
  LoopVerification result;
  CHECK(verifier->verify(good.old_keyframe, good.new_keyframe, {}, 0.0, result).code ==
        StatusCode::kInvalidInput);
  for (int field = 0; field < 4; ++field) {
    Scene scene = good;
    PlaceFeature& f = scene.new_keyframe.features[7];
    const float nan = std::numeric_limits<float>::quiet_NaN();
    if (field == 0) f.pixel.x() = nan;
    if (field == 1) f.bearing.y() = nan;
    if (field == 2) f.inverse_depth = std::numeric_limits<float>::infinity();
    if (field == 3) f.inverse_depth_sigma = nan;
    CHECK(verifyScene(*verifier, scene).fate == LoopFate::kInvalidInput);
  }
  LoopVerificationSettings settings;
  settings.pixel_sigma = 0;
  const auto wrong = std::make_unique<LoopVerifier>(makeRig(), settings);
  CHECK(wrong->verify(good.old_keyframe, good.new_keyframe, {}, 1.0, result).code ==
        StatusCode::kInvalidInput);
}

TEST_CASE("the same candidate gives the same bytes, whatever came before") {
  SceneSettings settings;
  settings.twins = 0.5;
  const Scene scene = makeScene(settings, 9);
  const auto fresh = std::make_unique<LoopVerifier>(makeRig());
  const auto used = std::make_unique<LoopVerifier>(makeRig());
  (void)verifyScene(*used, makeScene(settings, 10));
  const LoopVerification a = verifyScene(*fresh, scene);
  const LoopVerification b = verifyScene(*used, scene);
  CHECK(a.fate == b.fate);
  CHECK(a.samples == b.samples);
  CHECK(a.T_old_new.translation == b.T_old_new.translation);
  CHECK(a.T_old_new.rotation.coeffs() == b.T_old_new.rotation.coeffs());
  CHECK(a.covariance == b.covariance);
  CHECK(std::equal(a.inliers.begin(), a.inliers.end(), b.inliers.begin(), b.inliers.end()));
}

TEST_CASE("one point with the rotation, and five points with a scale, find the motion too") {
  Random random(12);
  const auto consensus = std::make_unique<LoopConsensus>();
  int one = 0;
  int five = 0;
  for (int n = 0; n < 20; ++n) {
    const SE3 truth(expSo3(0.4 * randomVector(random)), 0.5 * randomVector(random));
    MatchedPoints points = exactPoints(truth, random, 60);
    // A third is false.
    for (std::size_t i = 0; i < 20; ++i)
      points[3 * i].new_view.bearing = (randomVector(random) + 3 * Eigen::Vector3d::UnitZ()).normalized();
    const std::span<MatchedPoint> all(points.data(), points.size());
    ConsensusResult result;
    if (consensus->onePoint(all, truth.rotation * expSo3(0.01 * randomVector(random)), 7, result).ok() &&
        poseError(result.T_old_new, truth).norm() < 0.05) {
      ++one;
    }
    if (consensus->fivePoint(all, 7, result).ok() && poseError(result.T_old_new, truth).norm() < 0.05) ++five;
  }
  INFO(one << ' ' << five);
  CHECK(one >= 18);
  CHECK(five >= 17);
}
