// The vertical in the pose graph: what a chain learns of it, the optimum, and what loops can do to it.

#include "mapping/pose_graph/gravity_factor.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "mapping/pose_graph/robust_graph.hpp"

namespace swiftlet {
namespace {

constexpr double kDegree = M_PI / 180;

Eigen::Vector3d normal3(Random& random) { return {random.normal(), random.normal(), random.normal()}; }

Eigen::Vector3d upOf(const SE3& pose) { return pose.rotation.conjugate() * Eigen::Vector3d::UnitZ(); }

double tiltBetween(const SE3& a, const SE3& b) {
  return std::atan2(upOf(a).cross(upOf(b)).norm(), upOf(a).dot(upOf(b)));
}

/// A chain of poses that know their tilt to `sigma`, their odometry to `step` (rad, m).
struct UprightWalk {
  Random random{3};
  std::vector<SE3> truth{SE3(expSo3(Eigen::Vector3d(0.1, -0.2, 0.7)), {1, 2, 3})};
  PoseMatrix<SE3> Q = PoseMatrix<SE3>::Identity();
  double sigma = 0.1 * kDegree;

  UprightWalk(int poses, double step) {
    Q *= step * step;
    for (int k = 1; k < poses; ++k) {
      const Eigen::Vector3d turn(0.05 * std::sin(0.3 * k), 0.05 * std::cos(0.2 * k), 0.1);
      truth.push_back(truth.back() * SE3(expSo3(turn), {0.3, 0, 0.02}));
    }
  }

  RobustGraph<SE3> graph(bool with_gravity) {
    RobustGraph<SE3> out({static_cast<std::uint32_t>(truth.size()), 50}, robustGraphSettings<SE3>());
    Random draws(7);
    for (std::uint32_t k = 0; k < truth.size(); ++k) {
      Tilt tilt;
      if (with_gravity) {
        tilt.up_body = expSo3(sigma * normal3(draws)) * upOf(truth[k]);
        tilt.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
      }
      if (k == 0) {
        REQUIRE(out.beginComponent(truth[0], tilt).ok());
        continue;
      }
      PoseVector<SE3> error;
      error << std::sqrt(Q(0, 0)) * normal3(draws), std::sqrt(Q(3, 3)) * normal3(draws);
      RelativePose<SE3> edge{k - 1, k, truth[k - 1].inverse() * truth[k] * poseExp(error), Q.inverse()};
      REQUIRE(out.addPose(edge, tilt).ok());
    }
    return out;
  }
};

}  // namespace

TEST_CASE("A filter along the chain has the odometry's own tilt at every pose", "[pose_graph]") {
  Random random(1);
  Eigen::Matrix2d P = Eigen::Matrix2d::Zero();  // the filter's, in axes across the vertical
  Tilt previous;
  SE3 last;
  for (int k = 0; k < 20; ++k) {
    const SE3 pose(expSo3(normal3(random)), Eigen::Vector3d::Zero());
    Tilt tilt;
    tilt.up_body = upOf(pose);
    const double sigma = 2e-3 / (1 + 0.05 * k);  // better and better
    const Eigen::Matrix3d root = sigma * (Eigen::Matrix3d::Identity() + 0.2 * hat(normal3(random)));
    tilt.covariance = root * root.transpose();
    Eigen::Matrix<double, 3, 2> axes;
    axes.col(0) = tilt.up_body.unitOrthogonal();
    axes.col(1) = tilt.up_body.cross(axes.col(0));
    const Eigen::Matrix2d asked = axes.transpose() * tilt.covariance * axes;
    GravityFactor factor = gravityFactor(tilt);
    Eigen::Matrix2d information = axes.transpose() * factor.information * axes;
    if (k > 0) {
      // Vague enough that something is learned in every direction.
      const Eigen::Matrix3d R = (last.inverse() * pose).R();
      const Eigen::Matrix3d Q = 1e-4 * Eigen::Matrix3d::Identity();
      factor = gravityFactor(tilt, previous, R, Q);
      const Eigen::Matrix3d said = R.transpose() * previous.covariance * R + Q;
      information = (axes.transpose() * said * axes).inverse() + axes.transpose() * factor.information * axes;
    }
    CHECK((factor.information * tilt.up_body).norm() < 1e-6 * factor.information.norm());
    P = information.inverse();
    CHECK((P - asked).norm() < 1e-9 * asked.norm());
    previous = tilt;
    last = pose;
  }
  // What the relative pose has said is not said again.
  const GravityFactor nothing =
      gravityFactor(previous, previous, Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero());
  CHECK(nothing.information.norm() < 1e-6 / previous.covariance.trace());
  // What is no covariance says nothing, and costs the pose nothing.
  for (const double bad : {0.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    Tilt tilt = previous;
    tilt.covariance.col(0).setConstant(bad);
    tilt.covariance.row(0).setConstant(bad);
    tilt.covariance.col(1).setConstant(bad);
    tilt.covariance.row(1).setConstant(bad);
    CHECK(gravityFactor(tilt).information.allFinite());
    RobustGraph<SE3> graph({2, 1}, robustGraphSettings<SE3>());
    CHECK(graph.beginComponent(SE3(), tilt).ok());
    CHECK(graph.addPose({0, 1, SE3(), PoseMatrix<SE3>::Identity()}, tilt).ok());
    CHECK(graph.graph().poses.size() == graph.size());
  }
}

TEST_CASE("The optimum has no slope but what anchors hold, and the first pose keeps heading and place",
          "[pose_graph]") {
  UprightWalk walk(30, 0.01);
  RobustGraph<SE3> grown = walk.graph(true);
  PoseGraphOptimizer<SE3> optimizer({30, 40, 0});
  REQUIRE(optimizer.assign(grown.graph()).ok());
  Random random(5);
  std::vector<GravityFactor> factors;
  for (std::uint32_t k = 0; k < 30; ++k) {
    Tilt tilt;
    tilt.up_body = expSo3(0.02 * normal3(random)) * upOf(walk.truth[k]);
    tilt.covariance = 1e-5 * Eigen::Matrix3d::Identity();
    factors.push_back(gravityFactor(tilt));
    REQUIRE(optimizer.setGravity(k, factors.back()).ok());
  }
  RelativePose<SE3> loop{2, 28, walk.truth[2].inverse() * walk.truth[28], 1e4 * PoseMatrix<SE3>::Identity()};
  REQUIRE(optimizer.addEdge(loop).ok());
  const SE3 first = optimizer.graph().poses[0];
  OptimizeReport report;
  OptimizeEffort effort;
  effort.tolerance = 1e-14;
  REQUIRE(optimizer.optimize(effort, report).ok());
  CHECK(report.final_cost < report.initial_cost);
  CHECK((optimizer.graph().poses[0].translation - first.translation).norm() < 1e-9);
  const Eigen::Vector3d moved = logSo3(first.rotation.conjugate() * optimizer.graph().poses[0].rotation);
  CHECK(moved.norm() > 1e-4);  // it has come upright
  CHECK(std::abs(moved.dot(upOf(first))) < 1e-3 * moved.norm() + moved.squaredNorm());
  // No step of any pose lowers the cost: also of the first, for the piece as a whole is free.
  const auto costAt = [&](std::uint32_t k, int axis, double step) {
    PoseVector<SE3> xi = PoseVector<SE3>::Zero();
    xi[axis] = step;
    PoseGraphOptimizer<SE3> other = optimizer;
    REQUIRE(other.setPose(k, retracted(optimizer.graph().poses[k], xi)).ok());
    return other.cost();
  };
  for (const std::uint32_t k : {0U, 1U, 15U, 28U, 29U}) {
    for (int axis = 0; axis < 6; ++axis) {
      constexpr double kStep = 1e-4;
      const double forth = costAt(k, axis, kStep);
      const double back = costAt(k, axis, -kStep);
      const double slope = (forth - back) / (2 * kStep);
      const double curvature = (forth + back - 2 * optimizer.cost()) / (kStep * kStep);
      CAPTURE(k, axis, slope, curvature);
      CHECK(std::abs(slope) < 1e-6 * curvature);
    }
  }
}

TEST_CASE("Loops that agree with each other cannot tilt the map beyond what the odometry knows",
          "[pose_graph]") {
  // Two hundred steps of 2 mrad leave the relative tilt of both ends open by 2 degrees; twenty loops say 3.
  UprightWalk walk(200, 2e-3);
  std::vector<double> tilts;
  for (const bool with_gravity : {false, true}) {
    RobustGraph<SE3> graph = walk.graph(with_gravity);
    const SE3 bent(expSo3(Eigen::Vector3d(0, 3 * kDegree, 0)), Eigen::Vector3d::Zero());
    for (std::uint32_t k = 0; k < 20; ++k) {
      std::uint32_t id = 0;
      PoseMatrix<SE3> information = 1e4 * PoseMatrix<SE3>::Identity();
      const RelativePose<SE3> loop{k, 180 + k, walk.truth[k].inverse() * walk.truth[180 + k] * bent,
                                   information};
      REQUIRE(graph.addLoop(loop, id).ok());
    }
    bool moved = false;
    REQUIRE(graph.settle(1000, moved).ok());
    REQUIRE(graph.atRest());
    if (!with_gravity) REQUIRE(graph.believed() >= 10);  // or the test shows nothing
    double worst = 0;
    for (std::uint32_t k = 0; k < 200; ++k)
      worst = std::max(worst, tiltBetween(graph.pose(k), walk.truth[k]));
    tilts.push_back(worst / kDegree);
  }
  INFO("without " << tilts[0] << " degrees, with " << tilts[1]);
  CHECK(tilts[0] > 1);
  CHECK(tilts[1] < 0.4);  // four of its sigmas
}

TEST_CASE("A start that leans is put upright without a loop", "[pose_graph]") {
  // Ten degrees off when the flight begins, and known no better; from the fifth pose on the vertical is
  // known.
  const double off = 10 * kDegree;
  RobustGraph<SE3> graph({20, 5}, robustGraphSettings<SE3>());
  const SE3 lean(expSo3(Eigen::Vector3d(off, 0, 0)), Eigen::Vector3d::Zero());
  const SE3 step(expSo3(Eigen::Vector3d(0, 0, 0.1)), {0.3, 0, 0});
  SE3 truth;
  for (std::uint32_t k = 0; k < 10; ++k) {
    const double sigma = k < 5 ? off : 0.1 * kDegree;
    Tilt tilt;
    tilt.up_body = upOf(k < 5 ? lean * truth : truth);
    tilt.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
    if (k == 0) {
      REQUIRE(graph.beginComponent(lean, tilt).ok());
    } else {
      REQUIRE(graph.addPose({k - 1, k, step, 1e8 * PoseMatrix<SE3>::Identity()}, tilt).ok());
    }
    CHECK(graph.atRest() == (k != 5));
    bool moved = false;
    REQUIRE(graph.settle(1000, moved).ok());
    truth = truth * step;
  }
  CHECK(graph.atRest());
  for (std::uint32_t k = 0; k < 10; ++k) {
    CHECK(std::abs(upOf(graph.pose(k)).z() - 1) < 1e-4);
  }
  CHECK(graph.pose(0).translation.norm() < 1e-9);
}

TEST_CASE("Poses taken away leave what they knew of the vertical to the others", "[pose_graph]") {
  UprightWalk walk(120, 2e-3);
  std::vector<SE3> ends;
  for (const std::uint32_t removed : {0U, 50U}) {
    RobustGraph<SE3> graph = walk.graph(true);
    for (std::uint32_t k = 0; k < removed; ++k) REQUIRE(graph.removePose(k + 1, k).ok());
    std::uint32_t id = 0;
    const SE3 bent(expSo3(Eigen::Vector3d(0, 1 * kDegree, 0)), Eigen::Vector3d::Zero());
    const RelativePose<SE3> loop{0, graph.size() - 1, walk.truth[0].inverse() * walk.truth[119] * bent,
                                 1e6 * PoseMatrix<SE3>::Identity()};
    REQUIRE(graph.addLoop(loop, id).ok());
    bool moved = false;
    REQUIRE(graph.settle(1000, moved).ok());
    REQUIRE(graph.believed() == 1);
    ends.push_back(graph.pose(graph.size() - 1));
  }
  // The loop tilts both alike.
  CHECK(tiltBetween(ends[0], walk.truth[119]) > 0.2 * kDegree);
  CHECK(tiltBetween(ends[0], ends[1]) < 0.05 * kDegree);
}

}  // namespace swiftlet
