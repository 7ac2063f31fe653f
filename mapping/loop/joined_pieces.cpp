#include "mapping/loop/joined_pieces.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace swiftlet {
namespace {

/// Calls `with` for each accepted loop between two components.
template <typename With>
void forEachTie(const RobustGraph<SE3>& graph, const With& with) {
  for (std::uint32_t id = 0; id < graph.loops(); ++id) {
    const ChainedLoop<SE3>& chained = graph.selection().chained(id);
    if (graph.believed(id) && !chained.withinComponent()) {
      with(graph.loop(id), chained.from_component, chained.to_component);
    }
  }
}

}  // namespace

JoinedPieces::JoinedPieces() : fits_(loopSelectionSettings<SE3>().gate_chi_squared) {}

void JoinedPieces::follow(RobustGraph<SE3>& graph) {
  before_.swap(first_);
  first_.resize(graph.odometry().components());
  std::iota(first_.begin(), first_.end(), 0U);
  if (first_.size() < 2) return;
  forEachTie(graph, [this](const RelativePose<SE3>& /*tie*/, std::uint32_t a, std::uint32_t b) {
    const auto [low, high] = std::minmax(first_[a], first_[b]);
    std::replace(first_.begin(), first_.end(), std::uint32_t{high}, std::uint32_t{low});
  });
  if (first_ != before_) align(graph);
}

void JoinedPieces::align(RobustGraph<SE3>& graph) {
  placed_.assign(first_.size(), false);
  queue_.clear();
  const auto place = [this](std::uint32_t component) {
    if (placed_[component]) return;
    placed_[component] = true;
    queue_.push_back(component);
  };
  for (std::uint32_t k = 0; k < graph.size(); ++k) {
    if (graph.held(k)) place(graph.odometry().component(k));
  }
  for (std::uint32_t k = 0, done = 0; k < graph.size(); ++k) {
    place(graph.odometry().component(k));
    for (; done < queue_.size(); ++done) {
      const std::uint32_t here = queue_[done];
      forEachTie(graph, [&](const RelativePose<SE3>& /*tie*/, std::uint32_t a, std::uint32_t b) {
        if (a != here && b != here) return;
        const std::uint32_t other = a == here ? b : a;
        if (!placed_[other]) reach(graph, here, other);
        place(other);
      });
    }
  }
}

/// Moves `to` to where the loop with most information puts it, unless a loop between the two fits already.
void JoinedPieces::reach(RobustGraph<SE3>& graph, std::uint32_t from, std::uint32_t to) {
  double least = std::numeric_limits<double>::infinity();
  double best_known = 0;
  SE3 T_new_old;
  forEachTie(graph, [&](const RelativePose<SE3>& tie, std::uint32_t a, std::uint32_t b) {
    if (std::minmax(a, b) != std::minmax(from, to)) return;
    const SE3& first = graph.pose(tie.from);
    const SE3& second = graph.pose(tie.to);
    least = std::min(least, 2 * edgeCost(tie, first, second));
    if (tie.information.trace() <= best_known) return;
    best_known = tie.information.trace();
    const bool moves_second = graph.odometry().component(tie.to) == to;
    T_new_old = moves_second ? first * tie.T_from_to * second.inverse()
                             : second * tie.T_from_to.inverse() * first.inverse();
  });
  if (least <= fits_) return;
  for (std::uint32_t k = 0; k < graph.size(); ++k) {
    if (graph.odometry().component(k) == to) static_cast<void>(graph.setPose(k, T_new_old * graph.pose(k)));
  }
}

}  // namespace swiftlet
