#include "mapping/loop/loop_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

using Matrix6d = PoseMatrix<SE3>;

// Added to a covariance before it is inverted: no relative pose is known better.
constexpr double kLeastSigma = 1e-5;  // rad, m
constexpr double kLeastView = 0.1;    // of a node's spacing: nearer views are equally redundant

RobustGraphSettings graphSettings(const LoopSettings& settings) {
  RobustGraphSettings out = robustGraphSettings<SE3>();
  out.robust = out.selection.pairwise = settings.consistency;
  if (!settings.consistency) out.selection.gate_chi_squared = std::numeric_limits<double>::max();
  return out;
}

Matrix6d informationOf(const Matrix6d& covariance) {
  return informationFromCovariance<Matrix6d>(covariance + kLeastSigma * kLeastSigma * Matrix6d::Identity());
}

double turnOf(const Eigen::Quaterniond& rotation) {
  return 2 * std::acos(std::min(1.0, std::abs(rotation.w())));
}

/// In spacings of nodes.
double spacings(const SE3& T) {
  return T.translation.norm() / kNodeDistance + turnOf(T.rotation) / kNodeTurn;
}

std::uint32_t apart(std::uint32_t a, std::uint32_t b) { return a > b ? a - b : b - a; }

}  // namespace

bool viewsDiffer(const SE3& a, const SE3& b) {
  const SE3 T_a_b = a.inverse() * b;
  return T_a_b.translation.norm() > kNodeDistance || turnOf(T_a_b.rotation) > kNodeTurn;
}

LoopMap::LoopMap(const LoopSettings& settings, const LoopLimits& limits)
    : limits_(limits),
      graph_({static_cast<std::uint32_t>(limits.nodes), static_cast<std::uint32_t>(limits.loops)},
             graphSettings(settings)),
      loops_(limits.loops) {
  nodes_.reserve(limits.nodes);
  node_loops_.reserve(limits.nodes);
}

bool LoopMap::find(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& k) const {
  const auto flight = nodes_.begin() + static_cast<std::ptrdiff_t>(kept_);
  const bool is_kept = frame >= kKeptFrames;
  const auto found =
      std::lower_bound(is_kept ? nodes_.begin() : flight, is_kept ? flight : nodes_.end(), frame,
                       [](const Node& node, std::uint64_t f) { return node.frame < f; });
  k = static_cast<std::uint32_t>(found - nodes_.begin());
  return found != nodes_.end() && found->frame == frame && found->epoch == epoch;
}

Status LoopMap::add(const Node& node, const Link* link) {
  if (full()) return {StatusCode::kCapacityReached, "the map is full: the node is not added"};
  const bool finite = link == nullptr || (allFinite(link->T_previous_this) && link->covariance.allFinite());
  if (!allFinite(node.T_world_body) || !finite) {
    return {StatusCode::kInvalidInput, "the node is not finite"};
  }
  Status status;
  if (link != nullptr && !nodes_.empty()) {
    RelativePose<SE3> edge;
    edge.from = static_cast<std::uint32_t>(nodes_.size() - 1);
    edge.to = edge.from + 1;
    edge.T_from_to = link->T_previous_this;
    edge.information = informationOf(link->covariance);
    status = graph_.addPose(edge, node.tilt);
  } else {
    status = graph_.beginComponent(node.T_world_body, node.tilt);
  }
  if (status.ok()) nodes_.push_back(node);
  return status;
}

Status LoopMap::addKept(const Node& node, const Link* link, bool held) {
  if (kept_ != nodes_.size()) {
    return {StatusCode::kInvalidInput, "a kept node behind those of the flight"};
  }
  const auto k = static_cast<std::uint32_t>(kept_);
  Status status = add(node, link);
  if (status.ok() && held) status = graph_.hold(k);
  if (status.ok()) status = graph_.setPose(k, node.T_world_body);
  kept_ = nodes_.size();
  return status;
}

void LoopMap::releaseTies(std::uint32_t piece) {
  for (std::uint32_t id = 0; id < loops(); ++id) {
    const std::uint32_t a = component(loopEdge(id).from);
    const std::uint32_t b = component(loopEdge(id).to);
    // The whole set: the rest would be too few to be accepted, but still the largest set.
    const LoopVerdict verdict = graph_.selection().verdict(id);
    const bool in_set = verdict == LoopVerdict::kSelected || verdict == LoopVerdict::kUnsupported;
    if (in_set && a != b && (a == piece || b == piece)) static_cast<void>(graph_.release(id));
  }
  pieces_.follow(graph_);  // separates the piece, so that the next loops align it again
  graph_.search();
}

Status LoopMap::settle(int iterations, bool& moved) {
  pieces_.follow(graph_);
  const Status status = graph_.settle(iterations, moved);
  pieces_.follow(graph_);
  return status;
}

Status LoopMap::addLoop(std::uint32_t from, std::uint32_t to, const SE3& T_from_to,
                        const PoseMatrix<SE3>& covariance, std::uint32_t& id) {
  if (from >= to || to >= nodes_.size()) {
    return {StatusCode::kInvalidInput, "a loop must lead to an older node"};
  }
  RelativePose<SE3> edge;
  edge.from = from;
  edge.to = to;
  edge.T_from_to = T_from_to;
  edge.information = informationOf(covariance);
  Status status = graph_.addLoop(edge, id);
  if (status.code == StatusCode::kCapacityReached) {
    status = graph_.release(mostRepeatedLoop(edge));
    if (status.ok()) status = graph_.addLoop(edge, id);
  }
  if (!status.ok()) return status;
  loops_[id] = {nodes_[from].stamp, nodes_[to].stamp, nodes_[from].frame, nodes_[to].frame, false};
  return status;
}

/// The most redundant loop: its ends are nearest (in nodes) to those of another.
std::uint32_t LoopMap::mostRepeatedLoop(const RelativePose<SE3>& added) const {
  std::uint32_t best = 0;
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max();
  double best_variance = 0;
  for (std::uint32_t a = 0; a < graph_.loops(); ++a) {
    const RelativePose<SE3>& loop = graph_.loop(a);
    std::uint32_t nearest = apart(loop.from, added.from) + apart(loop.to, added.to);
    for (std::uint32_t b = 0; b < graph_.loops() && nearest > 0; ++b) {
      if (b == a) continue;
      const RelativePose<SE3>& other = graph_.loop(b);
      nearest = std::min(nearest, apart(loop.from, other.from) + apart(loop.to, other.to));
    }
    const double variance = 1 / loop.information.trace();
    if (nearest < least || (nearest == least && variance > best_variance)) {
      least = nearest;
      best = a;
      best_variance = variance;
    }
  }
  return best;
}

double LoopMap::stretch(std::uint32_t k) const {
  const bool before = linked(k);
  const bool after = linked(k + 1);
  if (!before && !after) return 0;
  const std::uint32_t first = before ? k - 1 : k;
  const std::uint32_t last = after ? k + 1 : k;
  const double seconds = (nodes_[last].stamp - nodes_[first].stamp).seconds();
  // A component's end has a neighbour on one side only: its first node counts twice the distance to it.
  const double ends = before ? 1 : 2;
  return ends * (spacings(graph_.odometry().relative(first, last)) + seconds / kNodeSeconds);
}

double LoopMap::viewDistance(std::uint32_t k) const {
  const OdometryChain<SE3>& chain = graph_.odometry();
  const SE3& here = pose(k);
  double least = 1;
  for (std::uint32_t other = 0; other < nodes_.size(); ++other) {
    const double distance = (pose(other).translation - here.translation).squaredNorm();
    if (other == k || distance >= kNodeDistance * kNodeDistance ||
        chain.component(other) != chain.component(k)) {
      continue;
    }
    const double turn = turnOf(here.rotation.conjugate() * pose(other).rotation);
    least = std::min(least, std::sqrt(distance) / kNodeDistance + turn / kNodeTurn);
  }
  return std::max(least, kLeastView);
}

std::uint32_t LoopMap::leastLoss() {
  node_loops_.assign(nodes_.size(), 0);
  for (std::uint32_t id = 0; id < graph_.loops(); ++id) {
    if (!selected(id)) continue;
    ++node_loops_[graph_.loop(id).from];
    ++node_loops_[graph_.loop(id).to];
  }
  std::uint32_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t k = 0; k + 1 < nodes_.size(); ++k) {
    if (graph_.held(k)) continue;
    const bool alone = !linked(k) && !linked(k + 1);
    const double extent = alone && node_loops_[k] > 0 ? 1 : stretch(k);
    const double held = extent * (1 + node_loops_[k]);
    if (kLeastView * held >= least) continue;
    const double loss = held * viewDistance(k);
    if (loss < least) {
      least = loss;
      best = k;
    }
  }
  return best;
}

bool LoopMap::makeRoom(Node& left) {
  if (nodes_.size() < 3) return false;
  const OdometryChain<SE3>& chain = graph_.odometry();
  const std::uint32_t k = leastLoss();
  if (graph_.held(k)) return false;  // leastLoss() found no node that is not held
  const bool back = linked(k);
  const bool ahead = linked(k + 1);
  std::uint32_t onto = k;
  if (back && ahead) {
    onto = chain.covariance(k - 1, k).trace() <= chain.covariance(k, k + 1).trace() ? k - 1 : k + 1;
  } else if (back || ahead) {
    onto = back ? k - 1 : k + 1;
  }
  for (std::uint32_t id = 0; id < graph_.loops(); ++id) {
    const RelativePose<SE3>& loop = graph_.loop(id);
    loops_[id].carried = loops_[id].carried || loop.from == k || loop.to == k;
  }
  if (!graph_.removePose(k, onto).ok()) return false;
  left = nodes_[k];
  nodes_.erase(nodes_.begin() + k);
  kept_ -= k < kept_ ? 1 : 0;
  ++nodes_removed_;
  return true;
}

LoopMapCounters LoopMap::counters() const {
  const LoopSelectionCounters& loops = graph_.selection().counters();
  return {nodes_removed_, loops.carried, loops.released, graph_.counters()};
}

}  // namespace swiftlet
