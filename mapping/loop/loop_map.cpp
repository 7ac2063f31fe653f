#include "mapping/loop/loop_map.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "mapping/pose_graph/pose_error.hpp"

namespace swiftlet {
namespace {

using Matrix6d = PoseMatrix<SE3>;

// Added to a covariance when it is inverted: no relative pose is known better.
constexpr double kLeastSigma = 1e-5;                  // rad, m
constexpr std::uint32_t kCliqueNodes = 2000;          // visited in a search: a few milliseconds
constexpr double kLeastView = 0.1;                    // of a node's spacing: nearer views say the same
constexpr double kGraduatedTail = 1e-3;               // that a true loop fits worse
constexpr std::uint32_t kGraduatedSolutions = 60;     // while the problem becomes the truncated one
constexpr int kGraduatedIterations = 3;               // of the optimizer, a solution
constexpr std::uint32_t kLeastBetweenComponents = 3;  // as LoopSelectionSettings::min_between
constexpr int kDof = PoseSpace<SE3>::kDof;

PoseGraphLimits graphLimits(const LoopLimits& limits) {
  PoseGraphLimits out;
  out.max_poses = limits.nodes;
  // Of a loop that gave way to another the edge stays, without weight, until the graph is built anew.
  out.max_edges = limits.nodes + 2 * limits.loops;
  return out;
}

LoopSelectionSettings selectionSettings(const LoopSettings& settings) {
  LoopSelectionSettings out = loopSelectionSettings<SE3>();
  if (!settings.consistency) out.gate_chi_squared = std::numeric_limits<double>::max();
  out.pairwise = settings.consistency && !settings.graduated;
  return out;
}

Matrix6d informationOf(const Matrix6d& covariance) {
  const Matrix6d floored = covariance + kLeastSigma * kLeastSigma * Matrix6d::Identity();
  const Matrix6d inverse = floored.ldlt().solve(Matrix6d::Identity());
  return 0.5 * (inverse + inverse.transpose());
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

/// Graduated non-convexity's problem: the graph with weights on its loops.
class LoopMap::Weighting : public WeightedLoops {
 public:
  explicit Weighting(LoopMap& map) : map_(map) {}

  Status solve(std::span<const double> weights, std::span<double> chi_squared) override {
    ++map_.counters_.graduated_solutions;
    PoseGraphOptimizer<SE3>& optimizer = map_.optimizer_;
    for (std::uint32_t id = 0; id < weights.size(); ++id) map_.setWeight(id, weights[id]);
    OptimizeEffort effort;
    effort.iterations = kGraduatedIterations;
    OptimizeReport report;
    const Status status = optimizer.optimize(effort, report);
    const PoseGraph<SE3>& graph = optimizer.graph();
    for (std::uint32_t id = 0; id < weights.size(); ++id) {
      const RelativePose<SE3>& edge = map_.selection_.loop(id);
      // What the odometry speaks against takes no part.
      chi_squared[id] = map_.selection_.verdict(id) == LoopVerdict::kSelected
                            ? 2 * edgeCost(edge, graph.poses[edge.from], graph.poses[edge.to])
                            : std::numeric_limits<double>::infinity();
    }
    return status;
  }

 private:
  LoopMap& map_;
};

LoopMap::LoopMap(const LoopSettings& settings, const LoopLimits& limits)
    : settings_(settings),
      limits_(limits),
      selection_({static_cast<std::uint32_t>(limits.nodes), static_cast<std::uint32_t>(limits.loops)},
                 selectionSettings(settings)),
      optimizer_(graphLimits(limits)),
      loops_(limits.loops),
      edges_(limits.loops),
      asked_(limits.loops) {
  nodes_.reserve(limits.nodes);
  weights_.reserve(limits.loops);
  chi_squared_.reserve(limits.loops);
  node_loops_.reserve(limits.nodes);
  scratch_.poses.reserve(limits.nodes);
  scratch_.edges.reserve(graphLimits(limits).max_edges);
}

bool LoopMap::find(std::uint64_t frame, std::uint32_t epoch, std::uint32_t& k) const {
  const auto found = std::lower_bound(nodes_.begin(), nodes_.end(), frame,
                                      [](const Node& node, std::uint64_t f) { return node.frame < f; });
  k = static_cast<std::uint32_t>(found - nodes_.begin());
  return found != nodes_.end() && found->frame == frame && found->epoch == epoch;
}

Status LoopMap::add(const Node& node) {
  if (full()) return {StatusCode::kCapacityReached, "the map has no room for another node"};
  if (!allFinite(node.T_world_body) || !allFinite(node.T_previous_this) || !node.covariance.allFinite()) {
    return {StatusCode::kInvalidInput, "a node that is not finite"};
  }
  Status status;
  const bool linked = node.linked && !nodes_.empty();
  if (linked) {
    RelativePose<SE3> edge;
    edge.from = static_cast<std::uint32_t>(nodes_.size() - 1);
    edge.to = edge.from + 1;
    edge.T_from_to = node.T_previous_this;
    edge.information = informationOf(node.covariance);
    status = selection_.odometry().append(edge.T_from_to, node.covariance);
    if (status.ok()) status = optimizer_.addPose(optimizer_.graph().poses.back() * edge.T_from_to);
    if (status.ok()) status = optimizer_.addEdge(edge);
  } else {
    status = selection_.odometry().beginComponent();
    if (status.ok()) status = optimizer_.addPose(node.T_world_body);
  }
  if (!status.ok()) return status;
  nodes_.push_back(node);
  nodes_.back().linked = linked;
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
  Status status = selection_.addLoop(edge, kCliqueNodes, id);
  if (status.code == StatusCode::kCapacityReached) {
    status = selection_.release(mostRepeatedLoop(edge));
    if (status.ok()) status = selection_.addLoop(edge, kCliqueNodes, id);
  }
  if (!status.ok()) return status;
  const bool another = loops_[id].new_frame != 0;  // one that gave way: its edge must go
  const Node& old_node = nodes_[from];
  const Node& new_node = nodes_[to];
  loops_[id] = Loop{old_node.stamp, new_node.stamp, old_node.frame, new_node.frame, false, false};
  asked_[id] = version_;
  if (another || optimizer_.graph().edges.size() >= graphLimits(limits_).max_edges) {
    status = rebuild();
  } else {
    edges_[id] = static_cast<std::uint32_t>(optimizer_.graph().edges.size());
    status = optimizer_.addEdge(edge);
    setWeight(id, 0);
  }
  weigh();
  return status;
}

/// Of loops that all agree the one with the nearest other: it says least that is not said.
std::uint32_t LoopMap::mostRepeatedLoop(const RelativePose<SE3>& added) const {
  std::uint32_t best = 0;
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max();
  double best_variance = 0;
  for (std::uint32_t a = 0; a < selection_.held(); ++a) {
    const RelativePose<SE3>& loop = selection_.loop(a);
    std::uint32_t nearest = apart(loop.from, added.from) + apart(loop.to, added.to);
    for (std::uint32_t b = 0; b < selection_.held() && nearest > 0; ++b) {
      if (b == a) continue;
      const RelativePose<SE3>& other = selection_.loop(b);
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
  const bool before = nodes_[k].linked;
  const bool after = nodes_[k + 1].linked;
  if (!before && !after) return 0;
  SE3 T;
  double seconds = 0;
  if (before) {
    T = nodes_[k].T_previous_this;
    seconds += (nodes_[k].stamp - nodes_[k - 1].stamp).seconds();
  }
  if (after) {
    T = T * nodes_[k + 1].T_previous_this;
    seconds += (nodes_[k + 1].stamp - nodes_[k].stamp).seconds();
  }
  // A component's first node leaves nothing behind it: as if as far again lay there.
  const double ends = before ? 1 : 2;
  return ends * (spacings(T) + seconds / kNodeSeconds);
}

double LoopMap::viewDistance(std::uint32_t k) const {
  const OdometryChain<SE3>& chain = selection_.odometry();
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
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    if (!loops_[id].selected) continue;
    ++node_loops_[selection_.loop(id).from];
    ++node_loops_[selection_.loop(id).to];
  }
  std::uint32_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t k = 0; k + 1 < nodes_.size(); ++k) {
    const bool alone = !nodes_[k].linked && !nodes_[k + 1].linked;
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
  const std::uint32_t k = leastLoss();
  Node& after = nodes_[k + 1];
  const bool back = nodes_[k].linked;
  const bool ahead = after.linked;
  std::uint32_t onto = k;
  if (back && ahead) {
    onto = nodes_[k].covariance.trace() <= after.covariance.trace() ? k - 1 : k + 1;
  } else if (back || ahead) {
    onto = back ? k - 1 : k + 1;
  }
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    const RelativePose<SE3>& loop = selection_.loop(id);
    const bool here = loop.from == k || loop.to == k;
    loops_[id].carried = loops_[id].carried || here;
    unsettled_ = unsettled_ || (here && loops_[id].selected);
  }
  if (!selection_.removePose(k, onto).ok()) return false;
  if (back && ahead) {
    const Matrix6d carry = poseAdjoint(after.T_previous_this.inverse());
    after.covariance += carry * nodes_[k].covariance * carry.transpose();
    after.T_previous_this = nodes_[k].T_previous_this * after.T_previous_this;
  } else if (ahead) {
    after.linked = false;
  }
  left = nodes_[k];
  // Poses of the others stay where they are.
  scratch_.poses.assign(optimizer_.graph().poses.begin(), optimizer_.graph().poses.end());
  scratch_.poses.erase(scratch_.poses.begin() + k);
  nodes_.erase(nodes_.begin() + k);
  ++counters_.nodes_removed;
  scratch_.edges.clear();
  const bool built = optimizer_.assign(scratch_).ok() && rebuild().ok();
  dropReleased();
  return built;
}

/// Loops that went with a node, and those that had only their support.
void LoopMap::dropReleased() {
  selected_ = 0;
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    if (loops_[id].selected && selection_.verdict(id) != LoopVerdict::kSelected) {
      loops_[id].selected = false;
      setWeight(id, 0);
      unsettled_ = true;
    }
    selected_ += loops_[id].selected ? 1U : 0U;
  }
}

/// The optimizer's graph from nodes and loops, its poses as they are.
Status LoopMap::rebuild() {
  scratch_.poses.assign(optimizer_.graph().poses.begin(), optimizer_.graph().poses.end());
  scratch_.edges.clear();
  for (std::uint32_t k = 1; k < nodes_.size(); ++k) {
    if (!nodes_[k].linked) continue;
    RelativePose<SE3> edge;
    edge.from = k - 1;
    edge.to = k;
    edge.T_from_to = nodes_[k].T_previous_this;
    edge.information = informationOf(nodes_[k].covariance);
    scratch_.edges.push_back(edge);
  }
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    // A loop that was given up waits for another to take its place; what it names is no longer kept true.
    const bool held = selection_.verdict(id) != LoopVerdict::kReleased;
    edges_[id] = held ? static_cast<std::uint32_t>(scratch_.edges.size()) : kNoEdge;
    if (held) scratch_.edges.push_back(selection_.loop(id));
  }
  const Status status = optimizer_.assign(scratch_);
  for (std::uint32_t id = 0; id < selection_.held(); ++id) setWeight(id, loops_[id].selected ? 1 : 0);
  return status;
}

void LoopMap::setWeight(std::uint32_t id, double weight) {
  if (edges_[id] != kNoEdge) static_cast<void>(optimizer_.setWeight(edges_[id], weight));
}

/// The selection's loops have their weight, the others none.
void LoopMap::weigh() {
  if (settings_.consistency && settings_.graduated) {
    graduate();
    return;
  }
  const auto selected = selection_.selected();
  auto next = selected.begin();
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    const bool chosen = next != selected.end() && *next == id;
    if (chosen) ++next;
    if (loops_[id].selected == chosen) continue;
    loops_[id].selected = chosen;
    setWeight(id, chosen ? 1 : 0);
    unsettled_ = true;
  }
  selected_ = static_cast<std::uint32_t>(selected.size());
}

void LoopMap::graduate() {
  weights_.resize(selection_.held());
  chi_squared_.resize(selection_.held());
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    weights_[id] = selection_.verdict(id) == LoopVerdict::kSelected ? 1 : 0;
  }
  GraduatedSettings settings;
  settings.max_chi_squared = chiSquaredOfTail(kDof, kGraduatedTail);
  settings.max_solutions = kGraduatedSolutions;
  Weighting problem(*this);
  GraduatedReport report;
  const Status status = selectGraduated(settings, problem, weights_, chi_squared_, report);
  dropThinTies();
  selected_ = 0;
  for (std::uint32_t id = 0; id < selection_.held(); ++id) {
    loops_[id].selected = status.ok() && weights_[id] == 1;
    selected_ += loops_[id].selected ? 1U : 0U;
    setWeight(id, loops_[id].selected ? 1 : 0);
  }
  unsettled_ = true;
}

/// Between two components a loop or two fit whatever they say.
void LoopMap::dropThinTies() {
  const OdometryChain<SE3>& chain = selection_.odometry();
  const auto ends = [&](std::uint32_t id) {
    const RelativePose<SE3>& loop = selection_.loop(id);
    return std::minmax({chain.component(loop.from), chain.component(loop.to)});
  };
  for (std::uint32_t a = 0; a < selection_.held(); ++a) {
    if (weights_[a] != 1 || ends(a).first == ends(a).second) continue;
    std::uint32_t same = 0;
    for (std::uint32_t b = 0; b < selection_.held(); ++b) {
      same += weights_[b] > 0 && ends(a) == ends(b) ? 1U : 0U;
    }
    if (same >= kLeastBetweenComponents) continue;
    for (std::uint32_t b = 0; b < selection_.held(); ++b) {
      if (ends(a) == ends(b)) weights_[b] = 0;
    }
  }
}

Status LoopMap::settle(int iterations, bool& moved) {
  moved = false;
  if (!unsettled_ && !reconsider()) return okStatus();
  OptimizeEffort work;
  work.iterations = iterations;
  OptimizeReport result;
  const Status status = optimizer_.optimize(work, result);
  ++counters_.optimizations;
  unsettled_ = status.ok() && !result.converged;
  if (!unsettled_) ++version_;
  moved = status.ok();
  return status;
}

/// Asks the next loop that the odometry speaks against whether it agrees with the map by now. True when the
/// selection has changed.
bool LoopMap::reconsider() {
  if (!settings_.consistency) return false;
  for (std::uint32_t tried = 0; tried < selection_.held(); ++tried) {
    const std::uint32_t id = next_asked_++ % selection_.held();
    if (asked_[id] == version_ || selection_.verdict(id) != LoopVerdict::kAgainstOdometry) continue;
    asked_[id] = version_;
    ++counters_.reconsidered;
    const RelativePose<SE3>& loop = selection_.loop(id);
    Matrix6d covariance;
    if (!optimizer_.relativeCovariance(loop.from, loop.to, covariance).ok()) return false;
    const SE3 T_from_to = pose(loop.from).inverse() * pose(loop.to);
    const PoseVector<SE3> error = poseLog(loop.T_from_to.inverse() * T_from_to);
    covariance += covarianceFromInformation(loop.information);
    const Eigen::LLT<Matrix6d> llt(covariance);
    if (llt.info() != Eigen::Success) return false;
    CycleTest gate;
    gate.chi_squared = llt.matrixL().solve(error).squaredNorm();
    gate.log_deviation = Matrix6d(llt.matrixL()).diagonal().array().log().sum();
    if (!(gate.chi_squared <= selectionSettings(settings_).gate_chi_squared)) return false;
    if (!selection_.reconsider(id, gate, kCliqueNodes).ok()) return false;
    weigh();
    counters_.taken_back += loops_[id].selected ? 1 : 0;
    return unsettled_;
  }
  return false;
}

LoopVerdict LoopMap::verdict(std::uint32_t id) const {
  const LoopVerdict verdict = selection_.verdict(id);
  return verdict == LoopVerdict::kSelected && !loops_[id].selected ? LoopVerdict::kInconsistent : verdict;
}

std::optional<double> LoopMap::loopWeight(std::uint32_t id) const {
  if (edges_[id] == kNoEdge) return std::nullopt;
  return optimizer_.weight(edges_[id]);
}

LoopMapCounters LoopMap::counters() const {
  LoopMapCounters out = counters_;
  out.loops_carried = selection_.counters().carried;
  out.loops_released = selection_.counters().released;
  return out;
}

}  // namespace swiftlet
