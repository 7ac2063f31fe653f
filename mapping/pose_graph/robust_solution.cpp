#include "mapping/pose_graph/robust_solution.hpp"

#include <algorithm>
#include <limits>
#include <optional>

namespace swiftlet {
namespace {

template <typename Pose>
Status copyPoses(const PoseGraph<Pose>& graph, const std::vector<std::uint32_t>& steps,
                 std::span<const std::uint32_t> fixed, RobustGraph<Pose>& robust) {
  for (std::size_t k = 0; k < graph.poses.size(); ++k) {
    if (const Status status = addNextPose(graph, steps, robust); !status.ok()) return status;
  }
  // A component is placed by its first fixed pose. Further fixed poses stay where the graph has them.
  std::vector<std::optional<Pose>> T_graph_component(robust.odometry().components());
  for (const std::uint32_t pose : fixed) {
    if (pose >= robust.size()) return {StatusCode::kInvalidInput, "no such pose to hold"};
    auto& T = T_graph_component[robust.odometry().component(pose)];
    if (!T) T = graph.poses[pose] * robust.pose(pose).inverse();
  }
  for (std::uint32_t k = 0; k < robust.size(); ++k) {
    const auto& T = T_graph_component[robust.odometry().component(k)];
    // setPose() also starts a solution if no loop does.
    if (const Status status = robust.setPose(k, T ? *T * robust.pose(k) : robust.pose(k)); !status.ok()) {
      return status;
    }
  }
  for (const std::uint32_t pose : fixed) {
    if (const Status status = robust.setPose(pose, graph.poses[pose]); !status.ok()) return status;
    if (const Status status = robust.hold(pose); !status.ok()) return status;
  }
  return okStatus();
}

}  // namespace

template <typename Pose>
std::vector<std::uint32_t> odometryEdges(const PoseGraph<Pose>& graph) {
  std::vector<std::uint32_t> steps(graph.poses.size(), kNoStep);
  for (const bool forward : {true, false}) {
    for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
      const auto& edge = graph.edges[e];
      const bool next = forward ? edge.to == edge.from + 1 : edge.from == edge.to + 1;
      std::uint32_t& step = steps[std::max(edge.from, edge.to)];
      if (next && step == kNoStep) step = e;
    }
  }
  return steps;
}

template <typename Pose>
Status addNextPose(const PoseGraph<Pose>& graph, const std::vector<std::uint32_t>& steps,
                   RobustGraph<Pose>& robust) {
  const std::uint32_t k = robust.size();
  return steps[k] == kNoStep ? robust.beginComponent(graph.poses[k]) : robust.addPose(graph.edges[steps[k]]);
}

template <typename Pose>
Status solveRobustly(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                     PoseGraph<Pose>& graph, RobustSolution& solution) {
  solution = {};
  for (const auto& edge : graph.edges) {
    if (edge.from >= graph.poses.size() || edge.to >= graph.poses.size()) {
      return {StatusCode::kInvalidInput, "an edge names a pose that does not exist"};
    }
  }
  const std::vector<std::uint32_t> steps = odometryEdges(graph);
  solution.is_odometry.assign(graph.edges.size(), false);
  for (const std::uint32_t e : steps) {
    if (e != kNoStep) solution.is_odometry[e] = true;
  }
  const auto odometry = std::count(solution.is_odometry.begin(), solution.is_odometry.end(), true);
  solution.loops = static_cast<std::uint32_t>(graph.edges.size() - static_cast<std::size_t>(odometry));
  if (solution.loops > kMaxFileLoops) {
    return {StatusCode::kCapacityReached, "more loops than can be compared in pairs"};
  }
  RobustGraph<Pose> robust({static_cast<std::uint32_t>(graph.poses.size()), solution.loops}, settings);
  if (const Status status = copyPoses(graph, steps, fixed, robust); !status.ok()) return status;
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    std::uint32_t id = 0;
    if (solution.is_odometry[e]) continue;
    if (const Status status = robust.holdLoop(graph.edges[e], id); !status.ok()) return status;
    solution.passed += robust.selection().verdict(id) != LoopVerdict::kAgainstOdometry ? 1 : 0;
  }
  robust.search();
  solution.components = robust.odometry().components();
  solution.exact = robust.selection().exact();
  solution.selected = robust.believed();
  if (const Status status = robust.start(solution.start); !status.ok()) return status;
  bool moved = false;
  if (const Status status = robust.settle(std::numeric_limits<int>::max(), moved); !status.ok())
    return status;
  if (const Status status = robust.settleAnew(); !status.ok()) return status;
  solution.solve = robust.solution();
  solution.counters = robust.counters();
  solution.kept = robust.believed();
  for (std::size_t e = 0, id = 0; e < graph.edges.size(); ++e) {
    solution.verdicts.push_back(solution.is_odometry[e] ? LoopVerdict::kSelected
                                                        : robust.verdict(static_cast<std::uint32_t>(id++)));
  }
  graph.poses = robust.graph().poses;
  return okStatus();
}

template std::vector<std::uint32_t> odometryEdges(const PoseGraph<SE2>&);
template std::vector<std::uint32_t> odometryEdges(const PoseGraph<SE3>&);
template Status addNextPose(const PoseGraph<SE2>&, const std::vector<std::uint32_t>&, RobustGraph<SE2>&);
template Status addNextPose(const PoseGraph<SE3>&, const std::vector<std::uint32_t>&, RobustGraph<SE3>&);
template Status solveRobustly(const RobustGraphSettings&, std::span<const std::uint32_t>, PoseGraph<SE2>&,
                              RobustSolution&);
template Status solveRobustly(const RobustGraphSettings&, std::span<const std::uint32_t>, PoseGraph<SE3>&,
                              RobustSolution&);

}  // namespace swiftlet
