#pragma once
// Random poses and pose graphs with their truth, for tests.

#include <Eigen/Eigenvalues>
#include <cmath>

#include "estimator/core/random.hpp"
#include "mapping/pose_graph/pose_error.hpp"
#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet::test {

/// Each tangent coordinate normal with `spread`; Exp of it.
template <typename Pose>
Pose randomPose(Random& random, double spread) {
  PoseTangent<Pose> step;
  for (int k = 0; k < step.size(); ++k) step[k] = spread * random.normal();
  return retracted(Pose(), step);
}

/// Positive definite, with cross terms, eigenvalues of some tens.
template <typename Pose>
PoseBlock<Pose> randomInformation(Random& random) {
  PoseBlock<Pose> root;
  for (Eigen::Index k = 0; k < root.size(); ++k) root.data()[k] = random.normal();
  PoseBlock<Pose> information = 10 * root * root.transpose();
  information = (0.5 * (information + information.transpose())).eval();  // to the last bit
  information.diagonal().array() += 10;
  return information;
}

template <typename Pose>
struct TrueGraph {
  PoseGraph<Pose> graph;  ///< poses: the truth
  std::vector<Pose> truth;
};

/// A walk of `poses` with `loops` random further edges; measurements off by `noise` in each coordinate.
template <typename Pose>
TrueGraph<Pose> randomGraph(std::uint64_t seed, std::uint32_t poses, std::uint32_t loops, double noise) {
  Random random(seed);
  TrueGraph<Pose> made;
  made.truth.emplace_back();
  for (std::uint32_t k = 1; k < poses; ++k)
    made.truth.push_back(made.truth.back() * randomPose<Pose>(random, 0.6));
  made.graph.poses = made.truth;
  const auto join = [&](std::uint32_t from, std::uint32_t to) {
    RelativePose<Pose> edge;
    edge.from = from;
    edge.to = to;
    edge.T_from_to = made.truth[from].inverse() * made.truth[to] * randomPose<Pose>(random, noise);
    edge.information = randomInformation<Pose>(random);
    made.graph.edges.push_back(edge);
  };
  for (std::uint32_t k = 1; k < poses; ++k) join(k - 1, k);
  for (std::uint32_t k = 0; k < loops; ++k) {
    const std::uint32_t from = random.below(poses);
    const std::uint32_t to = random.below(poses - 1);
    join(from, to < from ? to : to + 1);
  }
  return made;
}

/// Largest difference of two lists of poses, as steps.
template <typename Pose>
double poseDifference(const std::vector<Pose>& a, const std::vector<Pose>& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    largest = std::max(largest, relativeError(Pose(), a[k], b[k]).norm());
  }
  return largest;
}

}  // namespace swiftlet::test
