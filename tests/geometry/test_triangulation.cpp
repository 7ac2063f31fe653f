#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "estimator/geometry/triangulation.hpp"
#include "tests/geometry/random_vectors.hpp"

namespace swiftlet::test {
namespace {

struct Views {
  std::vector<SE3> poses;
  std::vector<Eigen::Vector3d> bearings;

  void add(const SE3& T_world_cam, const Eigen::Vector3d& point) {
    poses.push_back(T_world_cam);
    bearings.push_back((T_world_cam.inverse() * point).normalized());
  }
};

Views randomViews(Random& random, std::size_t count, const Eigen::Vector3d& point) {
  Views views;
  for (std::size_t i = 0; i < count; ++i) {
    // Any orientation: bearings beyond 90 degrees from the optical axis occur.
    views.add(SE3(expSo3(normalVector(random)), Eigen::Vector3d(100, 200, 5) + normalVector(random)), point);
  }
  return views;
}

}  // namespace

TEST_CASE("exact bearings give the exact point", "[triangulation]") {
  Random random(1);
  for (const std::size_t count : {2UL, 3UL, 10UL, 48UL}) {
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector3d point = Eigen::Vector3d(100, 200, 5) + 10 * normalVector(random).normalized();
      const Views views = randomViews(random, count, point);
      const Triangulation result = triangulate(views.bearings, views.poses);
      INFO(count << " views, parallax " << result.parallax);
      if (result.parallax < 0.01) continue;
      CHECK(result.state == TriangulationState::kValid);
      CHECK((result.point - point).norm() < 1e-8);
      CHECK(result.max_error < 1e-9);
    }
  }
}

TEST_CASE("the information is that of the errors: NEES over noise", "[triangulation]") {
  Random random(2);
  constexpr double kSigma = 1e-3;
  constexpr int kTrials = 2000;
  double sum = 0;
  double sum_dlt = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d point = Eigen::Vector3d(100, 200, 5) + 8 * normalVector(random).normalized();
    Views views = randomViews(random, 6, point);
    for (Eigen::Vector3d& b : views.bearings) b = (b + kSigma * normalVector(random)).normalized();
    TriangulationSettings settings;
    const Triangulation refined = triangulate(views.bearings, views.poses, settings);
    settings.refine_steps = 0;
    const Triangulation dlt = triangulate(views.bearings, views.poses, settings);
    REQUIRE(refined.valid());
    const Eigen::Matrix3d information = refined.information / (kSigma * kSigma);
    const Eigen::Vector3d error = refined.point - point;
    const Eigen::Vector3d error_dlt = dlt.point - point;
    sum += error.dot(information * error);
    sum_dlt += error_dlt.dot(information * error_dlt);
  }
  // Chi-square with 3 dof, mean of 2000: 3 +- 0.16 (3 sigma).
  CHECK(sum / kTrials == Approx(3.0).margin(0.16));
  CHECK(sum <= sum_dlt);
}

TEST_CASE("degenerate, behind, near, far and outlying points are told apart", "[triangulation]") {
  const SE3 left;
  const SE3 right(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.2, 0, 0));
  const auto stateOf = [&](const Eigen::Vector3d& point, double side = 1.0) {
    const std::vector<SE3> poses = {left, right};
    const std::vector<Eigen::Vector3d> bearings = {side * (left.inverse() * point).normalized(),
                                                   side * (right.inverse() * point).normalized()};
    return triangulate(bearings, poses).state;
  };
  CHECK(stateOf({0.3, 0.1, 3}) == TriangulationState::kValid);
  CHECK(stateOf({0, 0, 500}) == TriangulationState::kNoParallax);
  CHECK(stateOf({0.05, 0, 0.03}) == TriangulationState::kTooNear);
  CHECK(stateOf({0.3, 0.1, 3}, -1.0) == TriangulationState::kBehind);
  CHECK(stateOf({0.3, 0.1, -3}) == TriangulationState::kValid);  // a bearing may point backwards
  CHECK(stateOf({5, 0, 0}) == TriangulationState::kNoParallax);  // on the baseline

  Views views;
  Random random(3);
  for (int i = 0; i < 5; ++i) views.add(SE3(Eigen::Quaterniond::Identity(), {0.2 * i, 0, 0}), {0, 0, 4});
  views.bearings[2] = expSo3({0.05, 0, 0}) * views.bearings[2];
  CHECK(triangulate(views.bearings, views.poses).state == TriangulationState::kOutlier);
  views.bearings[2] = -views.bearings[2];
  CHECK(triangulate(views.bearings, views.poses).state == TriangulationState::kBehind);

  Views wide;
  wide.add(left, {0, 0, 1000});
  wide.add(SE3(Eigen::Quaterniond::Identity(), {100, 0, 0}), {0, 0, 1000});
  CHECK(triangulate(wide.bearings, wide.poses).state == TriangulationState::kTooFar);
}

TEST_CASE("pure rotation and bad input", "[triangulation]") {
  Views views;
  for (int i = 0; i < 4; ++i) views.add(SE3(expSo3({0, 0.1 * i, 0}), Eigen::Vector3d(1, 2, 3)), {1, 2, 8});
  CHECK(triangulate(views.bearings, views.poses).state == TriangulationState::kNoParallax);
  const std::span<const Eigen::Vector3d> one(views.bearings.data(), 1);
  CHECK(triangulate(one, std::span<const SE3>(views.poses.data(), 1)).state ==
        TriangulationState::kInvalidInput);
  CHECK(triangulate(one, views.poses).state == TriangulationState::kInvalidInput);
  views.bearings[1].x() = std::numeric_limits<double>::quiet_NaN();
  CHECK(triangulate(views.bearings, views.poses).state == TriangulationState::kInvalidInput);
}

}  // namespace swiftlet::test
