// The factor of a measured relative pose: Jacobians numerically, zero where it holds, meaning of its
// information.

#include "estimator/smoother/relative_pose_factor.hpp"

#include <catch2/catch.hpp>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::numericJacobian;
using test::randomVector;
using test::relativeDifference;

namespace {

SE3 randomPose(Random& random) { return {expSo3(randomVector(random, 1)), randomVector(random, 3)}; }

Matrix6d randomRoot(Random& random) {
  Matrix6d root;
  for (int i = 0; i < root.size(); ++i) root.data()[i] = random.normal();
  return root;
}

}  // namespace

TEST_CASE("A relative pose's Jacobians are those of its residual", "[smoother][relative_pose]") {
  Random random(5, 1);
  for (int trial = 0; trial < 50; ++trial) {
    const SE3 a = randomPose(random);
    const SE3 b = randomPose(random);
    const SE3 error(expSo3(randomVector(random, 0.4)), randomVector(random, 0.5));
    const SE3 measured = a.inverse() * b * error;
    const Matrix6d root = randomRoot(random);
    const RelativePoseFactor factor = relativePoseFactor(measured, root, a, b);
    const auto by_old = [&](const SE3& T) { return relativePoseFactor(measured, root, T, b).residual; };
    const auto by_new = [&](const SE3& T) { return relativePoseFactor(measured, root, a, T).residual; };
    CHECK(relativeDifference(factor.jacobian_old, numericJacobian<6, 6>(by_old, a)) < 1e-7);
    CHECK(relativeDifference(factor.jacobian_new, numericJacobian<6, 6>(by_new, b)) < 1e-7);
  }
}

TEST_CASE("A relative pose's residual is the perturbation of the measurement", "[smoother][relative_pose]") {
  Random random(6, 1);
  const SE3 a = randomPose(random);
  const SE3 b = randomPose(random);
  const SE3 exact = a.inverse() * b;
  CHECK(relativePoseFactor(exact, Matrix6d::Identity(), a, b).residual.norm() < 1e-12);
  // A measurement perturbed on the right by (phi, p) leaves -(phi, p), to first order.
  const Eigen::Vector3d phi = randomVector(random, 1e-5);
  const Eigen::Vector3d p = randomVector(random, 1e-5);
  const Matrix6d root = randomRoot(random);
  Vector6d perturbation;
  perturbation << phi, p;
  const Vector6d r = relativePoseFactor(exact * SE3(expSo3(phi), p), root, a, b).residual;
  CHECK((r + root * perturbation).norm() < 1e-3 * r.norm());
  // Both moved together by anything: nothing changes.
  const SE3 moved = randomPose(random);
  CHECK((relativePoseFactor(exact * SE3(expSo3(phi), p), root, moved * a, moved * b).residual - r).norm() <
        1e-12);
}
