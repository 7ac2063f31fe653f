#include "mapping/pose_graph/robust_graph.hpp"

#include <algorithm>
#include <limits>

namespace swiftlet {
namespace {

constexpr double kFitTail = 1e-3;

/// As far as the search for the largest set helps on the public graphs (docs/pose_graph.md).
constexpr std::uint32_t kNodes = 200;

/// 340 MB of pairs, and about a minute of pair tests.
constexpr std::uint32_t kCandidates = 30000;

/// While weights change a rough solution will do.
constexpr int kGraduatedIterations = 5;
constexpr double kGraduatedTolerance = 1e-4;

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

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

/// Loops that may be kept, by their edges in the whole graph.
struct Candidates {
  std::vector<std::uint32_t> edges;
  std::vector<double> weights;  ///< 1: taken for the first solution
};

/// Step 2: fates of all loops, and the members of the largest set.
template <typename Pose>
Status selectLoops(const RobustGraphSettings& settings, const OdometryChain<Pose>& chain,
                   const PoseGraph<Pose>& graph, Candidates& candidates, RobustGraphReport& report) {
  std::vector<std::uint32_t> passed;
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    if (report.fates[e] == EdgeFate::kOdometry) continue;
    const auto chained = chainLoop(chain, graph.edges[e]);
    if (!chained.withinComponent() ||
        odometryTest(chain, chained).chi_squared <= settings.selection.gate_chi_squared) {
      passed.push_back(e);
    }
  }
  report.passed = static_cast<std::uint32_t>(passed.size());
  if (passed.size() > settings.max_candidates) {
    return {StatusCode::kCapacityReached, "more loops agree with the odometry than can be compared in pairs"};
  }
  LoopSelection<Pose> selection({chain.size(), report.passed}, settings.selection);
  selection.odometry() = chain;
  for (const std::uint32_t e : passed) {
    std::uint32_t id = 0;
    if (const Status status = selection.holdLoop(graph.edges[e], id); !status.ok()) return status;
  }
  selection.search(settings.max_nodes);
  report.exact = selection.exact();
  report.selected = static_cast<std::uint32_t>(selection.selected().size());
  for (std::uint32_t id = 0; id < selection.held(); ++id) {
    const LoopVerdict verdict = selection.verdict(id);
    const bool in_set = verdict == LoopVerdict::kSelected || verdict == LoopVerdict::kUnsupported;
    report.fates[passed[id]] = EdgeFate::kInconsistent;
    if (!in_set) continue;
    const bool selected = verdict == LoopVerdict::kSelected;
    report.fates[passed[id]] = selected ? EdgeFate::kKept : EdgeFate::kUnsupported;
    const RelativePose<Pose>& loop = selection.loop(id);
    // Between components that nothing ties there is no solution that it could fit.
    if (!selected && chain.component(loop.from) != chain.component(loop.to)) continue;
    candidates.edges.push_back(passed[id]);
    candidates.weights.push_back(selected ? 1 : 0);
  }
  return okStatus();
}

/// Odometry and candidates; `numbers` are the candidates' edges in it.
template <typename Pose>
PoseGraph<Pose> reduced(const PoseGraph<Pose>& graph, const RobustGraphReport& report,
                        const Candidates& candidates, std::vector<std::uint32_t>& numbers) {
  PoseGraph<Pose> out;
  out.poses = graph.poses;
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    if (report.fates[e] == EdgeFate::kOdometry) out.edges.push_back(graph.edges[e]);
  }
  for (const std::uint32_t e : candidates.edges) {
    numbers.push_back(static_cast<std::uint32_t>(out.edges.size()));
    out.edges.push_back(graph.edges[e]);
  }
  return out;
}

/// Steps 3 to 5.
template <typename Pose>
Status solveReduced(const RobustGraphSettings& settings, std::span<const std::uint32_t> fixed,
                    Candidates& candidates, PoseGraph<Pose>& graph, RobustGraphReport& report) {
  std::vector<std::uint32_t> numbers;
  const PoseGraph<Pose> part = reduced(graph, report, candidates, numbers);
  PoseGraphOptimizer<Pose> optimizer({part.poses.size(), part.edges.size(), settings.max_factor_values});
  Status status = optimizer.assign(part);
  for (const std::uint32_t pose : fixed) {
    if (status.ok()) status = optimizer.hold(pose, true);
  }
  for (std::size_t k = 0; k < numbers.size() && status.ok(); ++k) {
    status = optimizer.setWeight(numbers[k], candidates.weights[k]);
  }
  if (status.ok()) status = optimizer.start(report.start);
  if (status.ok()) status = optimizer.optimize(settings.effort, report.solve);
  if (status.ok() && settings.method != RobustMethod::kSelection) {
    GraphLoops<Pose> problem(optimizer, numbers);
    std::vector<double> chi_squared(numbers.size());
    status = selectGraduated(settings.graduated, problem, candidates.weights, chi_squared, report.graduated);
    if (status.ok()) status = optimizer.optimize(settings.effort, report.solve);
  }
  if (!status.ok()) return status;
  for (std::size_t k = 0; k < candidates.edges.size(); ++k) {
    EdgeFate& fate = report.fates[candidates.edges[k]];
    const bool kept = candidates.weights[k] == 1;
    if (kept) {
      ++report.kept;
      fate = EdgeFate::kKept;
    } else if (fate == EdgeFate::kKept) {
      fate = EdgeFate::kAgainstSolution;
    }
  }
  graph.poses = optimizer.graph().poses;
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
  Candidates candidates;
  if (settings.method == RobustMethod::kGraduated) {
    for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
      if (is_odometry[e]) continue;
      report.fates[e] = EdgeFate::kKept;
      candidates.edges.push_back(e);
      candidates.weights.push_back(1);
    }
    report.selected = report.loops;
  } else {
    const Status status = selectLoops(settings, chain, graph, candidates, report);
    if (!status.ok()) return status;
  }
  return solveReduced(settings, fixed, candidates, graph, report);
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
