#include "mapping/pose_graph/robust_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/pose_graph/chance_limit.hpp"

namespace swiftlet {
namespace {

constexpr double kFitTail = 1e-3;

/// More nodes do not improve the largest set on the public graphs (docs/pose_graph.md).
constexpr std::uint32_t kNodes = 200;

/// Covariances of relative poses on the solved graph: 10 ms each on the largest public ones.
constexpr std::uint32_t kReconsidered = 300;

constexpr int kSolutionIterations = 100;

/// While weights change, rough solutions suffice.
constexpr int kGraduatedIterations = 5;
constexpr double kGraduatedTolerance = 1e-4;

/// Another minimum must be lower by at least this share of the cost, so that settleAnew() ends.
constexpr double kWorthwhile = 1e-3;

/// A pose that leans by more than this many sigmas of its tilt starts a solution, even without a loop.
constexpr double kLeaning = 3;

/// Logarithm of a chance above every limit.
constexpr double kNever = std::numeric_limits<double>::infinity();

/// Error of the cycle of a loop and the solution.
template <typename Pose>
PoseVector<Pose> cycleError(const OdometryChain<Pose>& chain, const ChainedLoop<Pose>& loop,
                            const std::vector<Pose>& solved) {
  const Pose Z = chain.pose(loop.from).inverse() * loop.T_chain_loop;
  return poseLog(Z.inverse() * (solved[loop.from].inverse() * solved[loop.to]));
}

}  // namespace

template <typename Pose>
RobustGraphSettings robustGraphSettings() {
  RobustGraphSettings settings;
  settings.selection = loopSelectionSettings<Pose>();
  settings.graduated.max_chi_squared = chiSquaredOfTail(PoseSpace<Pose>::kDof, kFitTail);
  settings.max_nodes = kNodes;
  settings.max_reconsidered = kReconsidered;
  settings.effort.iterations = kSolutionIterations;
  return settings;
}

template <typename Pose>
RobustGraph<Pose>::RobustGraph(const RobustGraphLimits& limits, const RobustGraphSettings& settings)
    : limits_(limits),
      settings_(settings),
      selection_({limits.poses, limits.loops}, settings.selection),
      // The edge of a replaced loop stays, with weight 0, until the graph is rebuilt.
      optimizer_({limits.poses, limits.poses + 2 * std::size_t{limits.loops}, 0}),
      members_(limits.loops),
      graduated_(settings.graduated),
      set_(selection_.consistency().words()) {
  step_edges_.reserve(limits.poses);
  known_.reserve(limits.poses);
  for (auto* list : {&weights_, &chi_squared_, &log_chances_}) list->reserve(limits.loops);
  graduated_ids_.reserve(limits.loops);
  open_.reserve(limits.loops);
  scratch_.poses.reserve(limits.poses);
  scratch_.edges.reserve(limits.poses + limits.loops);
}

template <typename Pose>
Status RobustGraph<Pose>::beginComponent(const Pose& T_map_body, const Tilt& tilt) {
  if (size() == limits_.poses) return {StatusCode::kCapacityReached, "the graph is full: no more poses"};
  Status status = optimizer_.addPose(T_map_body);
  if (status.ok()) status = selection_.odometry().beginComponent();
  if (!status.ok()) return status;
  step_edges_.push_back(kNoEdge);
  known_.push_back({tilt});
  return setGravity(size() - 1);
}

template <typename Pose>
Status RobustGraph<Pose>::addPose(const RelativePose<Pose>& odometry, const Tilt& tilt) {
  const std::uint32_t k = size();
  if (k == limits_.poses) return {StatusCode::kCapacityReached, "the graph is full: no more poses"};
  const bool forward = odometry.to == k && odometry.from + 1 == k;
  if (!forward && !(odometry.from == k && odometry.to + 1 == k)) {
    return {StatusCode::kInvalidInput, "the odometry does not connect the next pose to the last"};
  }
  Pose T_previous_this = odometry.T_from_to;
  PoseMatrix<Pose> covariance = covarianceFromInformation(odometry.information);
  if (!forward) {
    // Z Exp(zeta) inverted is Z^-1 Exp(-Ad(Z) zeta).
    const PoseMatrix<Pose> adjoint = poseAdjoint(odometry.T_from_to);
    covariance = (adjoint * covariance * adjoint.transpose()).eval();
    T_previous_this = odometry.T_from_to.inverse();
  }
  Status status = selection_.odometry().append(T_previous_this, covariance);
  if (status.ok()) status = optimizer_.addPose(pose(k - 1) * T_previous_this);
  if (!status.ok()) return status;
  step_edges_.push_back(static_cast<std::uint32_t>(graph().edges.size()));
  known_.push_back({tilt});
  status = optimizer_.addEdge(odometry);
  if (status.ok()) status = setGravity(k);
  if (leans(k)) restart(Phase::kSolve);
  return status;
}

/// Whether the pose is farther from the vertical than its tilt allows.
template <typename Pose>
bool RobustGraph<Pose>::leans(std::uint32_t k) const {
  if constexpr (PoseSpace<Pose>::kDof == 6) {
    const GravityFactor alone = gravityFactor(known_[k].tilt);
    const Eigen::Vector3d e = (pose(k).rotation.conjugate() * Eigen::Vector3d::UnitZ()).cross(alone.up_body);
    return e.dot(alone.information * e) > kLeaning * kLeaning;
  }
  return false;
}

template <typename Pose>
Status RobustGraph<Pose>::setGravity(std::uint32_t k) {
  if constexpr (PoseSpace<Pose>::kDof == 6) {
    if (!linked(k)) return optimizer_.setGravity(k, gravityFactor(known_[k].tilt));
    const Eigen::Matrix3d Q = odometry().covariance(k - 1, k).template topLeftCorner<3, 3>();
    const Eigen::Matrix3d R_previous_this = odometry().relative(k - 1, k).R();
    return optimizer_.setGravity(k, gravityFactor(known_[k].tilt, known_[k - 1].tilt, R_previous_this, Q));
  }
  return okStatus();
}

template <typename Pose>
Status RobustGraph<Pose>::addLoop(const RelativePose<Pose>& loop, std::uint32_t& id) {
  const Status status = selection_.addLoop(loop, settings_.max_nodes, id);
  if (!status.ok()) return status;
  forget(id);
  follow();
  return okStatus();
}

template <typename Pose>
void RobustGraph<Pose>::search() {
  selection_.search(settings_.max_nodes);
  follow();
}

template <typename Pose>
Status RobustGraph<Pose>::release(std::uint32_t id) {
  const Status status = selection_.release(id);
  if (status.ok()) follow();
  return status;
}

/// Copies poses and odometry to scratch_. A pose left out is bridged by the product of its two steps.
template <typename Pose>
void RobustGraph<Pose>::gather(std::uint32_t left_out) {
  const OdometryChain<Pose>& chain = odometry();
  scratch_.poses.assign(graph().poses.begin(), graph().poses.end());
  scratch_.edges.clear();
  if (left_out != kNoPose) scratch_.poses.erase(scratch_.poses.begin() + left_out);
  for (std::uint32_t k = 1; k < size(); ++k) {
    const bool bridges = k == left_out + 1;
    if (k == left_out || !linked(k) || (bridges && !linked(left_out))) continue;
    RelativePose<Pose> edge = graph().edges[step_edges_[k]];
    if (bridges) {
      edge.from = k - 2;
      edge.to = k;
      edge.T_from_to = chain.relative(k - 2, k);
      edge.information = informationFromCovariance<PoseMatrix<Pose>>(chain.covariance(k - 2, k));
    }
    edge.from -= edge.from > left_out ? 1 : 0;
    edge.to -= edge.to > left_out ? 1 : 0;
    scratch_.edges.push_back(edge);
  }
}

/// Builds the optimizer's graph from scratch_ (filled by gather()) and the loops that take part.
template <typename Pose>
Status RobustGraph<Pose>::assemble() {
  step_edges_.assign(scratch_.poses.size(), kNoEdge);
  for (std::uint32_t e = 0; e < scratch_.edges.size(); ++e) {
    step_edges_[std::max(scratch_.edges[e].from, scratch_.edges[e].to)] = e;
  }
  for (std::uint32_t id = 0; id < loops(); ++id) {
    Member& member = members_[id];
    if (selection_.verdict(id) == LoopVerdict::kReleased) member = Member{};
    member.edge = member.taken ? static_cast<std::uint32_t>(scratch_.edges.size()) : kNoEdge;
    if (member.taken) scratch_.edges.push_back(loop(id));
  }
  Status status = optimizer_.assign(scratch_);
  for (std::uint32_t k = 0; k < size() && status.ok(); ++k) {
    status = setGravity(k);
    if (held(k)) static_cast<void>(optimizer_.hold(k, true));
  }
  for (std::uint32_t id = 0; id < loops(); ++id) setWeight(id, members_[id].weight);
  for (std::size_t k = 0; phase_ == Phase::kGraduate && k < graduated_ids_.size(); ++k) {
    setWeight(graduated_ids_[k], weights_[k]);
  }
  return status;
}

template <typename Pose>
Status RobustGraph<Pose>::removePose(std::uint32_t pose, std::uint32_t onto) {
  const bool known = pose + 1 < size() && onto < size();
  if (!known || odometry().component(pose) != odometry().component(onto)) {
    return {StatusCode::kInvalidInput,
            "no such pose to remove, or no neighbour that can take over its loops"};
  }
  bool bent = false;
  for (std::uint32_t id = 0; id < loops(); ++id) {
    bent = bent || (believed(id) && (loop(id).from == pose || loop(id).to == pose));
  }
  gather(pose);
  known_.erase(known_.begin() + pose);
  Status status = selection_.removePose(pose, onto);
  if (status.ok()) status = assemble();
  if (bent) restart(Phase::kSolve);
  follow();
  return status;
}

template <typename Pose>
void RobustGraph<Pose>::setWeight(std::uint32_t id, double weight) {
  if (members_[id].edge != kNoEdge) static_cast<void>(optimizer_.setWeight(members_[id].edge, weight));
}

/// Clears the role of the loop that had this id before.
template <typename Pose>
void RobustGraph<Pose>::forget(std::uint32_t id) {
  setWeight(id, 0);
  if (believed(id)) restart(Phase::kSolve);
  members_[id] = Member{};
}

template <typename Pose>
Status RobustGraph<Pose>::take(std::uint32_t id) {
  Member& member = members_[id];
  member.taken = true;
  member.weight = 1;
  if (member.edge == kNoEdge && graph().edges.size() == limits_.poses + 2 * std::size_t{limits_.loops}) {
    gather(kNoPose);
    return assemble();
  }
  Status status;
  if (member.edge == kNoEdge) {
    member.edge = static_cast<std::uint32_t>(graph().edges.size());
    status = optimizer_.addEdge(loop(id));
  }
  setWeight(id, 1);
  return status;
}

/// Continues with `phase`, whatever was in progress. Only 4 is completed first.
template <typename Pose>
void RobustGraph<Pose>::restart(Phase phase) {
  if (phase_ == Phase::kGraduate) {
    behind_ = true;
    return;
  }
  // kAskOwn follows a solution anyway.
  if (phase == Phase::kAskOwn && (phase_ == Phase::kSolve || phase_ == Phase::kSolveAgain)) return;
  phase_ = phase;
  solve_iterations_ = 0;
}

/// Updates the loops that take part after a change of the selection.
template <typename Pose>
void RobustGraph<Pose>::follow() {
  bool changed = false;
  for (std::uint32_t id = 0; id < loops(); ++id) {
    Member& member = members_[id];
    const LoopVerdict verdict = selection_.verdict(id);
    if (verdict == LoopVerdict::kReleased) member.back = false;
    const bool chosen = verdict == LoopVerdict::kSelected || member.back;
    if (chosen == member.taken) continue;
    if (phase_ == Phase::kGraduate && chosen) {
      behind_ = true;  // takes part after 4
      continue;
    }
    changed = changed || chosen || member.weight > 0;
    if (chosen) {
      static_cast<void>(take(id));  // fails only for loops that the selection would have refused
    } else {
      setWeight(id, 0);
      member.taken = false;
      member.weight = 0;
    }
  }
  countBelieved();
  if (changed) {
    restart(Phase::kSolve);
  } else if (settings_.robust) {
    restart(Phase::kAskOwn);
  }
}

template <typename Pose>
void RobustGraph<Pose>::countBelieved() {
  believed_ = 0;
  for (std::uint32_t id = 0; id < loops(); ++id) believed_ += believed(id) ? 1 : 0;
}

template <typename Pose>
Status RobustGraph<Pose>::settle(int iterations, bool& moved) {
  moved = false;
  while (phase_ != Phase::kRest && iterations > 0) {
    Status status;
    switch (phase_) {
      case Phase::kSolve:
      case Phase::kSolveAgain:
        status = solve(iterations);
        moved = true;
        break;
      case Phase::kGraduate:
        status = graduate(iterations);
        moved = true;
        break;
      case Phase::kAskOwn:
        askOwn();
        --iterations;
        break;
      case Phase::kAskCovariance:
        askNext(iterations);
        break;
      case Phase::kRest:
        break;
    }
    if (!status.ok()) {
      // Do not leave intermediate weights in the optimizer.
      for (std::uint32_t id = 0; id < loops(); ++id) setWeight(id, members_[id].weight);
      phase_ = Phase::kRest;
      behind_ = false;
      return status;
    }
  }
  return okStatus();
}

template <typename Pose>
Status RobustGraph<Pose>::solve(int& iterations) {
  OptimizeEffort effort = settings_.effort;
  effort.iterations = std::min(iterations, effort.iterations - solve_iterations_);
  ++counters_.optimizations;
  const Status status = optimizer_.optimize(effort, solution_);
  if (!status.ok()) return status;
  iterations -= std::max(1, solution_.iterations);
  solve_iterations_ += solution_.iterations;
  if (!solution_.converged && solve_iterations_ < settings_.effort.iterations) return status;
  if (!settings_.robust) {
    phase_ = Phase::kRest;
  } else if (phase_ == Phase::kSolve) {
    beginGraduated();
  } else {
    phase_ = Phase::kAskOwn;
  }
  return status;
}

template <typename Pose>
void RobustGraph<Pose>::measureFits() {
  for (std::size_t k = 0; k < graduated_ids_.size(); ++k) {
    const RelativePose<Pose>& edge = loop(graduated_ids_[k]);
    // Loops released meanwhile do not take part.
    chi_squared_[k] =
        members_[graduated_ids_[k]].taken ? 2 * edgeCost(edge, pose(edge.from), pose(edge.to)) : kNever;
  }
}

/// Starts 4 from a solution. If all loops fit, 4 ends at once.
template <typename Pose>
void RobustGraph<Pose>::beginGraduated() {
  graduated_ids_.clear();
  weights_.clear();
  for (std::uint32_t id = 0; id < loops(); ++id) {
    if (!members_[id].taken) continue;
    graduated_ids_.push_back(id);
    weights_.push_back(members_[id].weight);
  }
  chi_squared_.resize(weights_.size());
  graduated_.begin();
  phase_ = Phase::kGraduate;
  weighNext();
}

template <typename Pose>
void RobustGraph<Pose>::weighNext() {
  measureFits();
  const bool more = graduated_.next(chi_squared_, weights_);
  for (std::size_t k = 0; k < weights_.size(); ++k) setWeight(graduated_ids_[k], weights_[k]);
  if (!more) endGraduated();
}

template <typename Pose>
Status RobustGraph<Pose>::graduate(int& iterations) {
  OptimizeEffort effort = settings_.effort;
  effort.iterations = std::min(iterations, kGraduatedIterations);
  effort.tolerance = kGraduatedTolerance;
  ++counters_.optimizations;
  ++counters_.graduated_solutions;
  const Status status = optimizer_.optimize(effort, solution_);
  if (!status.ok()) return status;
  iterations -= std::max(1, solution_.iterations);
  weighNext();
  return status;
}

template <typename Pose>
void RobustGraph<Pose>::endGraduated() {
  for (std::size_t k = 0; k < weights_.size(); ++k) members_[graduated_ids_[k]].weight = weights_[k];
  dropThinTies();
  countBelieved();
  phase_ = graduated_.report().solutions > 1 ? Phase::kSolveAgain : Phase::kAskOwn;
  solve_iterations_ = 0;
  if (!behind_) return;
  behind_ = false;
  phase_ = Phase::kSolve;
  follow();
}

/// Drops loops between two components if fewer than min_between are left: one or two always fit.
template <typename Pose>
void RobustGraph<Pose>::dropThinTies() {
  const auto ends = [&](std::uint32_t id) {
    const ChainedLoop<Pose>& chained = selection_.chained(id);
    return std::pair(chained.from_component, chained.to_component);
  };
  for (const std::uint32_t a : graduated_ids_) {
    if (!believed(a) || ends(a).first == ends(a).second) continue;
    const auto same = [&](std::uint32_t b) { return believed(b) && ends(a) == ends(b); };
    const auto ties = std::count_if(graduated_ids_.begin(), graduated_ids_.end(), same);
    if (ties >= settings_.selection.min_between) continue;
    for (const std::uint32_t b : graduated_ids_) {
      if (!same(b)) continue;
      members_[b].weight = 0;
      setWeight(b, 0);
    }
  }
}

/// Whether 5 tests the loop: it does not take part yet. Loops between components have no cycle of their own.
template <typename Pose>
bool RobustGraph<Pose>::isOpen(std::uint32_t id) const {
  return !members_[id].taken && selection_.verdict(id) != LoopVerdict::kReleased &&
         selection_.chained(id).withinComponent();
}

/// First test of 5, for all open loops. Those that pass change the solution least and make it more certain.
template <typename Pose>
void RobustGraph<Pose>::askOwn() {
  open_.clear();
  for (std::uint32_t id = 0; id < loops(); ++id) {
    if (!isOpen(id)) continue;
    const ChainedLoop<Pose>& chained = selection_.chained(id);
    const CycleTest test =
        cycleTest<Pose>(chained.covariance, cycleError(odometry(), chained, graph().poses));
    const bool fit = test.chi_squared <= settings_.graduated.max_chi_squared;
    open_.push_back({id, 0, fit ? logChance<Pose>(test, odometry().logBox(chained.to)) : kNever});
  }
  counters_.reconsidered += open_.size();
  if (believeFits()) return;
  phase_ = open_.empty() ? Phase::kRest : Phase::kAskCovariance;
  orderOpen();
}

/// Sorts the open loops by their number of conflicts with the loops of the sets.
template <typename Pose>
void RobustGraph<Pose>::orderOpen() {
  std::fill(set_.begin(), set_.end(), 0);
  for (std::uint32_t id = 0; id < loops(); ++id) {
    const LoopVerdict verdict = selection_.verdict(id);
    if (verdict == LoopVerdict::kSelected || verdict == LoopVerdict::kUnsupported) setBit(set_, id);
  }
  const std::uint32_t size = countBits(set_);
  for (OpenLoop& open : open_) {
    open.conflicts = size - countBoth(selection_.consistency().row(open.id), set_);
    open.log_chance = kNever;
  }
  std::sort(open_.begin(), open_.end(), [](const OpenLoop& a, const OpenLoop& b) {
    return std::pair(a.conflicts, a.id) < std::pair(b.conflicts, b.id);
  });
  next_open_ = 0;
  covariances_ = 0;
}

/// Second test of 5, up to the next loop that needs a covariance of the solution.
template <typename Pose>
void RobustGraph<Pose>::askNext(int& iterations) {
  const double limit = settings_.selection.gate_chi_squared;
  while (next_open_ < open_.size() && covariances_ < settings_.max_reconsidered) {
    OpenLoop& open = open_[next_open_++];
    if (!isOpen(open.id)) continue;
    const ChainedLoop<Pose>& chained = selection_.chained(open.id);
    const PoseVector<Pose> error = cycleError(odometry(), chained, graph().poses);
    // The solution's covariance is smaller than that of the odometry alone: a loop that fails with the latter
    // would fail the test.
    const PoseMatrix<Pose> loose = chained.covariance + odometry().covariance(chained.from, chained.to);
    if (!(cycleTest<Pose>(loose, error).chi_squared <= limit)) continue;
    ++covariances_;
    --iterations;
    PoseMatrix<Pose> known;
    if (!optimizer_.relativeCovariance(chained.from, chained.to, known).ok()) continue;
    const CycleTest test = cycleTest<Pose>(chained.covariance + known, error);
    if (test.chi_squared <= limit) open.log_chance = logChance<Pose>(test, odometry().logBox(chained.to));
    return;
  }
  if (!believeFits()) phase_ = Phase::kRest;
}

/// Accepts the open loops that fit, if random loops would be unlikely to. True if there are any.
template <typename Pose>
bool RobustGraph<Pose>::believeFits() {
  log_chances_.clear();
  for (const OpenLoop& open : open_) {
    if (open.log_chance < kNever) log_chances_.push_back(open.log_chance);
  }
  // Loops that failed the gate count as tested, too: leaving them out would use a result already seen.
  std::size_t left = 0;
  for (std::uint32_t id = 0; id < loops(); ++id) {
    left += !believed(id) && selection_.verdict(id) != LoopVerdict::kReleased ? 1 : 0;
  }
  const double limit = std::min(std::log(settings_.selection.max_gate_chance),
                                logDiscoveryLimit(settings_.selection.max_false, left, log_chances_));
  std::uint32_t count = 0;
  // Added only now, because a new edge would require a new factor for the next covariance.
  for (const OpenLoop& open : open_) {
    if (!(open.log_chance <= limit) || !isOpen(open.id)) continue;
    members_[open.id].back = take(open.id).ok();
    ++count;
  }
  counters_.taken_back += count;
  if (count == 0) return false;
  countBelieved();
  phase_ = Phase::kSolve;
  solve_iterations_ = 0;
  return true;
}

template <typename Pose>
Status RobustGraph<Pose>::settleAnew() {
  const auto dropped = [](const Member& member) { return member.taken && member.weight < 1; };
  const auto costNow = [this] {
    return optimizer_.cost() + 0.5 * settings_.graduated.max_chi_squared * (loops() - believed_);
  };
  while (std::any_of(members_.begin(), members_.end(), dropped)) {
    const std::vector<Pose> poses = graph().poses;
    const std::vector<Member> members = members_;
    const OptimizeReport solution = solution_;
    const double cost = costNow();
    StartReport start;
    Status status = optimizer_.start(start, true);
    if (!status.ok() || start.choice == StartChoice::kGiven) return status;
    // Treat dropped loops as not selected.
    for (std::uint32_t id = 0; id < loops(); ++id) {
      if (dropped(members_[id]) && selection_.chained(id).withinComponent()) members_[id].taken = false;
    }
    restart(Phase::kSolve);
    bool moved = false;
    status = settle(std::numeric_limits<int>::max(), moved);
    for (std::uint32_t id = 0; id < loops(); ++id) {
      members_[id].taken = members_[id].taken || members[id].taken;
    }
    if (status.ok() && costNow() < (1 - kWorthwhile) * cost) continue;
    for (std::uint32_t k = 0; k < size(); ++k) static_cast<void>(optimizer_.setPose(k, poses[k]));
    for (std::uint32_t id = 0; id < loops(); ++id) {
      const std::uint32_t edge = members_[id].edge;
      members_[id] = members[id];
      members_[id].edge = edge;
      setWeight(id, members[id].weight);
    }
    countBelieved();
    solution_ = solution;
    break;
  }
  return okStatus();
}

template <typename Pose>
LoopVerdict RobustGraph<Pose>::verdict(std::uint32_t id) const {
  const Member& member = members_[id];
  if (member.weight == 1) return LoopVerdict::kSelected;
  if (member.taken) return LoopVerdict::kAgainstSolution;
  const LoopVerdict verdict = selection_.verdict(id);
  return verdict == LoopVerdict::kSelected ? LoopVerdict::kUnsupported : verdict;
}

template <typename Pose>
std::optional<double> RobustGraph<Pose>::weight(std::uint32_t id) const {
  if (members_[id].edge == kNoEdge) return std::nullopt;
  return optimizer_.weight(members_[id].edge);
}

template RobustGraphSettings robustGraphSettings<SE2>();
template RobustGraphSettings robustGraphSettings<SE3>();
template class RobustGraph<SE2>;
template class RobustGraph<SE3>;

}  // namespace swiftlet
