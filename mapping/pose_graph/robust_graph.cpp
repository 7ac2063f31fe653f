#include "mapping/pose_graph/robust_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "mapping/pose_graph/chance_limit.hpp"

namespace swiftlet {
namespace {

constexpr double kFitTail = 1e-3;

/// As far as the search for the largest set helps on the public graphs (docs/pose_graph.md).
constexpr std::uint32_t kNodes = 200;

/// 340 MB of pairs, and about a minute of pair tests.
constexpr std::uint32_t kCandidates = 30000;

/// Covariances of relative poses on the solved graph: 10 ms each on the largest public ones.
constexpr std::uint32_t kReconsidered = 300;

/// The usual 5 %: were all loops random, one of twenty graphs would believe one.
constexpr double kMaxFalse = 0.05;

/// While weights change a rough solution will do.
constexpr int kGraduatedIterations = 5;
constexpr double kGraduatedTolerance = 1e-4;

/// Loops come back in at most so many rounds; most graphs need two or three.
constexpr int kRounds = 10;

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Logarithm of a chance that no limit reaches.
constexpr double kNever = std::numeric_limits<double>::infinity();

/// The optimizer, as graduated selection sees it.
template <typename Pose>
class GraphLoops : public WeightedLoops {
 public:
  GraphLoops(PoseGraphOptimizer<Pose>& optimizer, std::span<const std::uint32_t> edges)
      : optimizer_(optimizer), edges_(edges) {
    effort_.iterations = kGraduatedIterations;
    effort_.tolerance = kGraduatedTolerance;
  }

  Status solve(std::span<const double> weights, std::span<double> chi_squared) override {
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      if (const Status status = optimizer_.setWeight(edges_[k], weights[k]); !status.ok()) return status;
    }
    OptimizeReport report;
    const Status status = optimizer_.optimize(effort_, report);
    const PoseGraph<Pose>& graph = optimizer_.graph();
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const auto& edge = graph.edges[edges_[k]];
      chi_squared[k] = 2 * edgeCost(edge, graph.poses[edge.from], graph.poses[edge.to]);
    }
    return status;
  }

 private:
  PoseGraphOptimizer<Pose>& optimizer_;
  std::span<const std::uint32_t> edges_;
  OptimizeEffort effort_;
};

/// Loops of the optimizer's graph.
struct TakenLoops {
  std::vector<std::uint32_t> edges;    ///< in the whole graph
  std::vector<std::uint32_t> numbers;  ///< in the optimizer's
  std::vector<double> weights;
};

/// A loop that was not selected, and how many of the largest set it contradicts.
struct OpenLoop {
  std::uint32_t edge = 0;
  std::uint32_t conflicts = 0;
  double log_chance = kNever;  ///< beside the present solution, while step 5 looks
  bool fits = false;
};

/// Step 2: fates of all loops.
template <typename Pose>
Status selectLoops(const RobustGraphSettings& settings, const OdometryChain<Pose>& chain,
                   const PoseGraph<Pose>& graph, TakenLoops& taken, std::vector<OpenLoop>& open,
                   RobustGraphReport& report) {
  std::vector<std::uint32_t> passed;
  std::vector<double> least_chances;
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    if (report.fates[e] == EdgeFate::kOdometry) continue;
    const auto chained = chainLoop(chain, graph.edges[e]);
    if (!chained.withinComponent()) {
      passed.push_back(e);
      continue;
    }
    const CycleTest gate = odometryTest(chain, chained);
    if (gate.chi_squared <= settings.selection.gate_chi_squared) passed.push_back(e);
    least_chances.push_back(logChance<Pose>({0, gate.log_deviation}, chain.logBox(chained.to)));
  }
  report.passed = static_cast<std::uint32_t>(passed.size());
  if (passed.size() > settings.max_candidates) {
    return {StatusCode::kCapacityReached, "more loops agree with the odometry than can be compared in pairs"};
  }
  LoopSelectionSettings adapted = settings.selection;
  adapted.max_gate_chance =
      std::min(adapted.max_gate_chance, std::exp(logChanceLimit(settings.max_false, least_chances)));
  LoopSelection<Pose> selection({chain.size(), report.passed}, adapted);
  selection.odometry() = chain;
  for (const std::uint32_t e : passed) {
    std::uint32_t id = 0;
    if (const Status status = selection.holdLoop(graph.edges[e], id); !status.ok()) return status;
  }
  selection.search(settings.max_nodes);
  report.exact = selection.exact();
  report.selected = static_cast<std::uint32_t>(selection.selected().size());
  std::vector<std::uint64_t> set(selection.consistency().words());
  for (std::uint32_t id = 0; id < selection.held(); ++id) {
    if (selection.verdict(id) != LoopVerdict::kInconsistent) setBit(set, id);
  }
  const std::uint32_t size = countBits(set);
  for (std::uint32_t id = 0; id < selection.held(); ++id) {
    const std::uint32_t e = passed[id];
    const LoopVerdict verdict = selection.verdict(id);
    if (verdict == LoopVerdict::kSelected) {
      report.fates[e] = EdgeFate::kKept;
      taken.edges.push_back(e);
      taken.weights.push_back(1);
      continue;
    }
    report.fates[e] = verdict == LoopVerdict::kUnsupported ? EdgeFate::kUnsupported : EdgeFate::kInconsistent;
    if (chain.component(graph.edges[e].from) != chain.component(graph.edges[e].to)) continue;
    open.push_back({e, size - countBoth(selection.consistency().row(id), set), kNever, false});
  }
  return okStatus();
}

/// Loops chosen, to the poses of the graph.
template <typename Pose>
class RobustSolution {
 public:
  RobustSolution(const RobustGraphSettings& settings, const OdometryChain<Pose>& chain,
                 const PoseGraph<Pose>& graph, TakenLoops& taken, std::size_t spare_edges,
                 const RobustGraphReport& report)
      : settings_(settings), chain_(chain), whole_(graph), taken_(taken), loops_(report.loops) {
    part_.poses = graph.poses;
    for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
      if (report.fates[e] == EdgeFate::kOdometry) part_.edges.push_back(graph.edges[e]);
    }
    for (const std::uint32_t e : taken.edges) {
      taken_.numbers.push_back(static_cast<std::uint32_t>(part_.edges.size()));
      part_.edges.push_back(graph.edges[e]);
    }
    optimizer_ = std::make_unique<PoseGraphOptimizer<Pose>>(
        PoseGraphLimits{part_.poses.size(), part_.edges.size() + spare_edges, settings.max_factor_values});
  }

  Status solve(std::span<const std::uint32_t> fixed, RobustGraphReport& report) {
    Status status = optimizer_->assign(part_);
    for (const std::uint32_t pose : fixed) {
      if (status.ok()) status = optimizer_->hold(pose, true);
    }
    if (status.ok()) status = optimizer_->start(report.start);
    if (status.ok()) status = optimizer_->optimize(settings_.effort, report.solve);
    return status;
  }

  Status graduate(RobustGraphReport& report) {
    GraphLoops<Pose> problem(*optimizer_, taken_.numbers);
    std::vector<double> chi_squared(taken_.numbers.size());
    GraduatedReport graduated;
    const Status status =
        selectGraduated(settings_.graduated, problem, taken_.weights, chi_squared, graduated);
    report.graduated.solutions += graduated.solutions;
    report.graduated.kept = graduated.kept;
    report.graduated.settled = graduated.settled;
    return status.ok() ? optimizer_->optimize(settings_.effort, report.solve) : status;
  }

  /// Step 5 once: how many loops came back.
  Status takeBack(std::vector<OpenLoop>& open, std::uint32_t& count) {
    // Those that fit with their own covariance first: they bend the solution least, and it knows more then.
    count = 0;
    for (const bool own_covariance : {true, false}) {
      if (const Status status = findFits(open, own_covariance); !status.ok()) return status;
      std::erase_if(open, [](const OpenLoop& loop) { return loop.fits; });
      count = static_cast<std::uint32_t>(back_.size());
      if (count > 0) break;
    }
    // Added only now: a new edge would cost a new factor for the next covariance.
    for (const std::uint32_t e : back_) {
      if (const Status status = take(e); !status.ok()) return status;
    }
    back_.clear();
    return okStatus();
  }

  [[nodiscard]] const std::vector<Pose>& poses() const { return optimizer_->graph().poses; }

 private:
  /// A loop and the solution, round.
  struct Cycle {
    ChainedLoop<Pose> chained;
    PoseVector<Pose> error;

    Cycle(const OdometryChain<Pose>& chain, const PoseGraph<Pose>& solved, const RelativePose<Pose>& loop)
        : chained(chainLoop(chain, loop)) {
      const Pose Z = chain.pose(chained.from).inverse() * chained.T_chain_loop;
      error = poseLog(Z.inverse() * (solved.poses[chained.from].inverse() * solved.poses[chained.to]));
    }
  };

  /// Which open loops fit, and not by chance: to back_.
  Status findFits(std::vector<OpenLoop>& open, bool own_covariance) {
    std::vector<double> log_chances;
    std::uint32_t asked = 0;
    for (OpenLoop& loop : open) {
      const Cycle cycle(chain_, optimizer_->graph(), whole_.edges[loop.edge]);
      CycleTest test;
      double limit = settings_.graduated.max_chi_squared;
      if (own_covariance) {
        test = cycleTest<Pose>(cycle.chained.covariance, cycle.error);
      } else if (asked < settings_.max_reconsidered && mayAgree(cycle)) {
        ++asked;
        limit = settings_.selection.gate_chi_squared;
        PoseMatrix<Pose> known;
        const Status status = optimizer_->relativeCovariance(cycle.chained.from, cycle.chained.to, known);
        if (!status.ok()) return status;
        test = cycleTest<Pose>(cycle.chained.covariance + known, cycle.error);
      }
      loop.log_chance =
          test.chi_squared <= limit ? logChance<Pose>(test, chain_.logBox(cycle.chained.to)) : kNever;
      if (loop.log_chance < kNever) log_chances.push_back(loop.log_chance);
    }
    const double limit = std::min(std::log(settings_.selection.max_gate_chance),
                                  logDiscoveryLimit(settings_.max_false, loopsLeft(), log_chances));
    for (OpenLoop& loop : open) {
      loop.fits = loop.log_chance <= limit;
      if (loop.fits) back_.push_back(loop.edge);
    }
    return okStatus();
  }

  /// Not in the solution, those that the odometry spoke against too: how well one agrees with it was seen
  /// before.
  [[nodiscard]] std::size_t loopsLeft() const {
    return loops_ - static_cast<std::size_t>(std::count(taken_.weights.begin(), taken_.weights.end(), 1.0));
  }

  /// The solution knows the relative pose better than the odometry alone: what fails this would fail the
  /// test.
  [[nodiscard]] bool mayAgree(const Cycle& cycle) const {
    const PoseMatrix<Pose> loose =
        cycle.chained.covariance + chain_.covariance(cycle.chained.from, cycle.chained.to);
    return cycleTest<Pose>(loose, cycle.error).chi_squared <= settings_.selection.gate_chi_squared;
  }

  Status take(std::uint32_t e) {
    const auto found = std::find(taken_.edges.begin(), taken_.edges.end(), e);
    if (found != taken_.edges.end()) {
      taken_.weights[static_cast<std::size_t>(found - taken_.edges.begin())] = 1;
      return okStatus();
    }
    taken_.edges.push_back(e);
    taken_.numbers.push_back(static_cast<std::uint32_t>(optimizer_->graph().edges.size()));
    taken_.weights.push_back(1);
    return optimizer_->addEdge(whole_.edges[e]);
  }

  const RobustGraphSettings& settings_;
  const OdometryChain<Pose>& chain_;
  const PoseGraph<Pose>& whole_;
  TakenLoops& taken_;
  std::size_t loops_;
  PoseGraph<Pose> part_;
  std::unique_ptr<PoseGraphOptimizer<Pose>> optimizer_;
  std::vector<std::uint32_t> back_;
};

/// Steps 3 to 5.
template <typename Pose>
Status solveTaken(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                  const OdometryChain<Pose>& chain, TakenLoops& taken, std::vector<OpenLoop>& open,
                  PoseGraph<Pose>& graph, RobustGraphReport& report) {
  std::stable_sort(open.begin(), open.end(),
                   [](const OpenLoop& a, const OpenLoop& b) { return a.conflicts < b.conflicts; });
  RobustSolution<Pose> solution(settings, chain, graph, taken, open.size(), report);
  Status status = solution.solve(fixed, report);
  if (status.ok() && settings.method != RobustMethod::kSelection) status = solution.graduate(report);
  if (settings.method == RobustMethod::kSelectionAndGraduated) {
    std::uint32_t count = 1;
    for (int round = 0; round < kRounds && count > 0 && status.ok(); ++round) {
      status = solution.takeBack(open, count);
      if (status.ok() && count > 0) status = solution.graduate(report);
    }
  }
  if (!status.ok()) return status;
  for (std::size_t k = 0; k < taken.edges.size(); ++k) {
    EdgeFate& fate = report.fates[taken.edges[k]];
    if (taken.weights[k] == 1) {
      ++report.kept;
      fate = EdgeFate::kKept;
    } else if (fate == EdgeFate::kKept) {
      fate = EdgeFate::kAgainstSolution;
    }
  }
  graph.poses = solution.poses();
  return okStatus();
}

}  // namespace

template <typename Pose>
RobustGraphSettings robustGraphSettings() {
  RobustGraphSettings settings;
  settings.selection = loopSelectionSettings<Pose>();
  settings.graduated.max_chi_squared = chiSquaredOfTail(PoseSpace<Pose>::kDof, kFitTail);
  settings.max_nodes = kNodes;
  settings.max_candidates = kCandidates;
  settings.max_reconsidered = kReconsidered;
  settings.max_false = kMaxFalse;
  settings.effort.iterations = 100;
  return settings;
}

template <typename Pose>
Status chainOdometry(const PoseGraph<Pose>& graph, OdometryChain<Pose>& chain,
                     std::vector<bool>& is_odometry) {
  std::vector<std::uint32_t> step(graph.poses.size(), kNone);  // edge to each pose from the one before
  is_odometry.assign(graph.edges.size(), false);
  for (const bool forward : {true, false}) {
    for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
      const auto& edge = graph.edges[e];
      if (edge.from >= graph.poses.size() || edge.to >= graph.poses.size()) {
        return {StatusCode::kInvalidInput, "an edge names a pose that is not there"};
      }
      const bool next = forward ? edge.to == edge.from + 1 : edge.from == edge.to + 1;
      const std::uint32_t later = std::max(edge.from, edge.to);
      if (next && step[later] == kNone) {
        step[later] = e;
        is_odometry[e] = true;
      }
    }
  }
  for (std::uint32_t k = 0; k < graph.poses.size(); ++k) {
    Status status;
    if (step[k] == kNone) {
      status = chain.beginComponent();
    } else {
      const auto& edge = graph.edges[step[k]];
      PoseMatrix<Pose> covariance = covarianceFromInformation(edge.information);
      if (edge.to == k) {
        status = chain.append(edge.T_from_to, covariance);
      } else {
        // Z Exp(zeta) inverted is Z^-1 Exp(-Ad(Z) zeta).
        const PoseMatrix<Pose> adjoint = poseAdjoint(edge.T_from_to);
        covariance = (adjoint * covariance * adjoint.transpose()).eval();
        status = chain.append(edge.T_from_to.inverse(), covariance);
      }
    }
    if (!status.ok()) return status;
  }
  return okStatus();
}

template <typename Pose>
Status solveRobustly(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                     PoseGraph<Pose>& graph, RobustGraphReport& report) {
  report = {};
  OdometryChain<Pose> chain(static_cast<std::uint32_t>(graph.poses.size()));
  std::vector<bool> is_odometry;
  if (const Status status = chainOdometry(graph, chain, is_odometry); !status.ok()) return status;
  report.components = chain.components();
  for (const bool odometry : is_odometry) {
    report.fates.push_back(odometry ? EdgeFate::kOdometry : EdgeFate::kAgainstOdometry);
    report.loops += odometry ? 0U : 1U;
  }
  TakenLoops taken;
  std::vector<OpenLoop> open;
  if (settings.method == RobustMethod::kGraduated) {
    for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
      if (is_odometry[e]) continue;
      report.fates[e] = EdgeFate::kKept;
      taken.edges.push_back(e);
      taken.weights.push_back(1);
    }
    report.selected = report.loops;
  } else {
    const Status status = selectLoops(settings, chain, graph, taken, open, report);
    if (!status.ok()) return status;
  }
  return solveTaken(settings, fixed, chain, taken, open, graph, report);
}

template RobustGraphSettings robustGraphSettings<SE2>();
template RobustGraphSettings robustGraphSettings<SE3>();
template Status chainOdometry(const PoseGraph<SE2>&, OdometryChain<SE2>&, std::vector<bool>&);
template Status chainOdometry(const PoseGraph<SE3>&, OdometryChain<SE3>&, std::vector<bool>&);
template Status solveRobustly(const RobustGraphSettings&, std::span<const std::uint32_t>, PoseGraph<SE2>&,
                              RobustGraphReport&);
template Status solveRobustly(const RobustGraphSettings&, std::span<const std::uint32_t>, PoseGraph<SE3>&,
                              RobustGraphReport&);

}  // namespace swiftlet
