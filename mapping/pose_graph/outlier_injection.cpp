#include "mapping/pose_graph/outlier_injection.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "estimator/core/random.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {
namespace {

/// Least difference of the numbers of a false loop's poses; an edge between neighbours would be odometry.
constexpr std::uint32_t kMinGap = 2;

SE2 randomPose(const Eigen::Vector2d& low, const Eigen::Vector2d& high, Random& random) {
  const double x = random.uniform(low.x(), high.x());
  const double y = random.uniform(low.y(), high.y());
  return {random.uniform(-M_PI, M_PI), {x, y}};
}

/// Uniform rotation: Shoemake, "Uniform random rotations", Graphics Gems III, 1992.
SE3 randomPose(const Eigen::Vector3d& low, const Eigen::Vector3d& high, Random& random) {
  const double x = random.uniform(low.x(), high.x());
  const double y = random.uniform(low.y(), high.y());
  const double z = random.uniform(low.z(), high.z());
  const double u = random.uniform();
  const double a = random.uniform(0, 2 * M_PI);
  const double b = random.uniform(0, 2 * M_PI);
  const double s = std::sqrt(1 - u);
  const double c = std::sqrt(u);
  return {Eigen::Quaterniond(c * std::cos(b), s * std::sin(a), s * std::cos(a), c * std::sin(b)), {x, y, z}};
}

/// A draw of N(0, information^-1); directions without information are left at 0.
template <typename Pose>
Pose randomNoise(const PoseMatrix<Pose>& information, Random& random) {
  const Eigen::SelfAdjointEigenSolver<PoseMatrix<Pose>> eigen(information);
  PoseVector<Pose> xi = PoseVector<Pose>::Zero();
  for (int k = 0; k < xi.size(); ++k) {
    const double normal = random.normal();
    const double eigenvalue = eigen.eigenvalues()[k];
    // Smaller eigenvalues are rounding that remains after a reader has clamped indefinite information.
    if (eigenvalue > 1e-12 * eigen.eigenvalues().maxCoeff()) {
      xi += normal / std::sqrt(eigenvalue) * eigen.eigenvectors().col(k);
    }
  }
  return poseExp(xi);
}

/// Steps between neighbouring poses from the odometry edges; where one is missing, from the graph's poses.
template <typename Pose>
struct Odometry {
  std::vector<Pose> step;  ///< T_k_k+1

  explicit Odometry(const PoseGraph<Pose>& graph) {
    step.resize(graph.poses.size() - 1);
    for (std::size_t k = 0; k < step.size(); ++k) {
      step[k] = graph.poses[k].inverse() * graph.poses[k + 1];
    }
    for (const auto& edge : graph.edges) {
      if (isOdometry(edge) && edge.from < step.size()) {
        step[edge.from] = edge.T_from_to;
      }
    }
  }
};

template <typename Pose>
struct Injector {
  PoseGraph<Pose>& graph;
  std::vector<std::uint32_t> loops;  ///< edges whose information is drawn
  decltype(Pose().translation) low, high;
  Random random;

  Injector(PoseGraph<Pose>& target, std::uint64_t seed) : graph(target), random(seed) {
    for (std::uint32_t k = 0; k < graph.edges.size(); ++k) {
      if (!isOdometry(graph.edges[k])) {
        loops.push_back(k);
      }
    }
    if (loops.empty()) {
      loops.push_back(0);
    }
    low = high = graph.poses.front().translation;
    for (const Pose& T : graph.poses) {
      low = low.cwiseMin(T.translation);
      high = high.cwiseMax(T.translation);
    }
  }

  [[nodiscard]] const PoseMatrix<Pose>& drawInformation() {
    return graph.edges[loops[random.below(static_cast<std::uint32_t>(loops.size()))]].information;
  }

  /// Draws two rows of `length` poses that do not overlap. Returns the first pose of each.
  std::pair<std::uint32_t, std::uint32_t> drawRows(std::uint32_t length) {
    const auto starts = static_cast<std::uint32_t>(graph.poses.size()) - length + 1;
    const std::uint32_t gap = std::max(kMinGap, length);
    // Uniform over pairs (i, j) with j >= i + gap: two different numbers below `numbers`, the larger shifted.
    const std::uint32_t numbers = starts - gap + 1;
    const std::uint32_t a = random.below(numbers);
    const std::uint32_t other = random.below(numbers - 1);
    const std::uint32_t b = other < a ? other : other + 1;
    return {std::min(a, b), std::max(a, b) + gap - 1};
  }

  void addGroup(const Odometry<Pose>& odometry, std::uint32_t length) {
    const auto [i, j] = drawRows(length);
    const Pose target = randomPose(low, high, random);
    Pose T = graph.poses[i].inverse() * target;
    for (std::uint32_t k = 0; k < length; ++k) {
      const PoseMatrix<Pose> information = drawInformation();
      const Pose noise = length > 1 ? randomNoise<Pose>(information, random) : Pose();
      graph.edges.push_back({i + k, j + k, T * noise, information});
      if (k + 1 < length) {
        T = odometry.step[i + k].inverse() * T * odometry.step[j + k];
      }
    }
  }
};

}  // namespace

std::uint32_t outlierCount(std::uint32_t true_loops, double share) {
  const double inside = std::clamp(share, 0.0, 0.999);  // 0.999: a thousand false loops per true one
  return static_cast<std::uint32_t>(std::lround(true_loops * inside / (1 - inside)));
}

template <typename Pose>
Status injectOutliers(const OutlierInjection& injection, PoseGraph<Pose>& graph) {
  const std::uint32_t length = std::max(injection.group_size, 1U);
  if (graph.edges.empty() || graph.poses.size() < std::size_t{length} + std::max(kMinGap, length)) {
    return {StatusCode::kInvalidInput, "too few poses for false loops (or for their groups), or no edge"};
  }
  Injector<Pose> injector(graph, injection.seed);
  const Odometry<Pose> odometry(graph);
  graph.edges.reserve(graph.edges.size() + injection.count);
  for (std::uint32_t left = injection.count; left > 0;) {
    const std::uint32_t now = std::min(left, length);
    injector.addGroup(odometry, now);
    left -= now;
  }
  return okStatus();
}

template Status injectOutliers(const OutlierInjection&, PoseGraph<SE2>&);
template Status injectOutliers(const OutlierInjection&, PoseGraph<SE3>&);

}  // namespace swiftlet
