#include "mapping/pose_graph/odometry_start.hpp"

#include <deque>

namespace swiftlet {
namespace {

/// Edges of each pose, compressed: of pose k, edges[begin[k]] to edges[begin[k + 1] - 1], in the graph's
/// order.
struct Incidence {
  std::vector<std::uint32_t> begin;
  std::vector<std::uint32_t> edges;
};

template <typename Pose>
Incidence incidence(const PoseGraph<Pose>& graph) {
  Incidence lists;
  lists.begin.assign(graph.poses.size() + 1, 0);
  for (const RelativePose<Pose>& edge : graph.edges) {
    ++lists.begin[edge.from + 1];
    ++lists.begin[edge.to + 1];
  }
  for (std::size_t k = 0; k < graph.poses.size(); ++k) lists.begin[k + 1] += lists.begin[k];
  lists.edges.resize(2 * graph.edges.size());
  std::vector<std::uint32_t> next(lists.begin.begin(), lists.begin.end() - 1);
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    lists.edges[next[graph.edges[e].from]++] = e;
    lists.edges[next[graph.edges[e].to]++] = e;
  }
  return lists;
}

struct Visit {
  std::uint32_t pose;
  std::uint32_t edge;
};

}  // namespace

template <typename Pose>
void odometryStart(PoseGraph<Pose>& graph) {
  const Incidence lists = incidence(graph);
  std::vector<bool> placed(graph.poses.size(), false);
  std::deque<Visit> waiting;
  for (std::uint32_t first = 0; first < graph.poses.size(); ++first) {
    if (placed[first]) continue;
    graph.poses[first] = Pose();
    placed[first] = true;
    std::uint32_t at = first;
    while (true) {
      for (std::uint32_t k = lists.begin[at]; k < lists.begin[at + 1]; ++k) {
        const RelativePose<Pose>& edge = graph.edges[lists.edges[k]];
        const std::uint32_t other = edge.from == at ? edge.to : edge.from;
        if (placed[other]) continue;
        const bool neighbours = other + 1 == at || at + 1 == other;
        if (neighbours) {
          waiting.push_front({other, lists.edges[k]});
        } else {
          waiting.push_back({other, lists.edges[k]});
        }
      }
      while (!waiting.empty() && placed[waiting.front().pose]) waiting.pop_front();
      if (waiting.empty()) break;
      const Visit visit = waiting.front();
      waiting.pop_front();
      const RelativePose<Pose>& edge = graph.edges[visit.edge];
      graph.poses[visit.pose] = edge.to == visit.pose ? graph.poses[edge.from] * edge.T_from_to
                                                      : graph.poses[edge.to] * edge.T_from_to.inverse();
      placed[visit.pose] = true;
      at = visit.pose;
    }
  }
}

template void odometryStart(PoseGraph<SE2>&);
template void odometryStart(PoseGraph<SE3>&);

}  // namespace swiftlet
