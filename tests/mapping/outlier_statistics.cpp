// False loops injected into the public pose graphs: how many are rejected, how many true loops go with them,
// and what the trajectory loses; run by hand, prints figures.
//   outlier_statistics [--graphs a,b] [--shares 10,30,50,70,90] [--seeds 1,2,3] [--group N] [--alone VALUES]
//                      [--csv FILE] [--loops FILE] [--max-false X]
// Graphs: all of SWIFTLET_DATA/pose_graphs that have at least 20 loops, a chi-squared per degree of freedom
// of 0.05 to 2 at the optimum, and at least 90 % of their own loops inside the 99 % check against their
// odometry; the others are named with the reason. Shares: percent of all loops after injection. Settings:
// robustGraphSettings(), the same for all, with another limit of chance where --max-false says so. --alone:
// graduated non-convexity on all loops from the odometry as well, where the normal equations' factor takes no
// more than so many numbers. --csv: a row a run, appended as it ends. --loops: every loop of every run, what
// became of it, and what the tests say of it.
//
// Error: RMS of positions after a rigid fit, against the truth where there is one. Where there is none,
// against the optimum of the graph without false loops; the ratio then takes the expected error e of that
// optimum into account, sqrt(e^2 + difference^2) / e, where e is that of optima of graphs whose measurements
// were drawn anew about the optimum with their own information (`kDraws` of them). A second ratio is to the
// error that solveRobustly() itself leaves when nothing is injected.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/alignment.hpp"
#include "firmware_host/lab/modules/g2o_file.hpp"
#include "mapping/pose_graph/outlier_injection.hpp"
#include "mapping/pose_graph/robust_solution.hpp"
#include "tests/mapping/graph_data.hpp"
#include "tests/support/cpu_time.hpp"

namespace swiftlet::test {
namespace {

constexpr std::uint32_t kLeastLoops = 20;
constexpr double kLeastChi = 0.05;  // per degree of freedom
constexpr double kMostChi = 2;
constexpr double kCheckTail = 0.01;
constexpr double kLeastInside = 0.9;
constexpr int kDraws = 4;

struct Options {
  std::vector<std::string> graphs;
  std::vector<double> shares{10, 30, 50, 70, 90};
  std::vector<std::uint64_t> seeds{1, 2, 3};
  std::uint32_t group = 1;
  bool flown = false;
  bool all = false;
  double max_false = 0;
  std::string csv;
  std::string loops;
};

std::vector<Eigen::Vector3d> positions(const std::vector<SE3>& poses) {
  std::vector<Eigen::Vector3d> out;
  for (const SE3& T : poses) out.push_back(T.translation);
  return out;
}
std::vector<Eigen::Vector3d> positions(const std::vector<SE2>& poses) {
  std::vector<Eigen::Vector3d> out;
  for (const SE2& T : poses) out.emplace_back(T.translation.x(), T.translation.y(), 0);
  return out;
}

template <typename Pose>
double errorOf(const std::vector<Pose>& poses, const std::vector<Eigen::Vector3d>& reference) {
  Alignment fit;
  const std::vector<Eigen::Vector3d> from = positions(poses);
  if constexpr (PoseSpace<Pose>::kDof == 3) {
    (void)alignYaw(from, reference, fit);
  } else {
    (void)alignRigid(from, reference, fit);
  }
  return fit.rms;
}

/// `id x y ...` or `id x y z ...`; empty where there is none.
std::vector<Eigen::Vector3d> readTruth(const GraphReference& reference, const G2oGraph& graph) {
  // Ours with noise on the angles and that of other releases are the same walk.
  const bool walk = reference.name == "manhattan" || reference.name.starts_with("M3500_") ||
                    reference.name.starts_with("input_M3500");
  const std::string name = walk ? "manhattanOlson3500" : reference.name;
  std::ifstream file(std::filesystem::path(reference.path).parent_path() / (name + "_groundtruth.txt"));
  std::map<std::int64_t, Eigen::Vector3d> by_id;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::int64_t id = 0;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    if (!(words >> id >> p.x() >> p.y())) continue;
    if (reference.space) words >> p.z();
    by_id[id] = p;
  }
  std::vector<Eigen::Vector3d> truth;
  for (const std::int64_t id : graph.ids) {
    const auto found = by_id.find(id);
    if (found == by_id.end()) return {};
    truth.push_back(found->second);
  }
  return truth;
}

template <typename Pose>
std::vector<Pose> optimum(const PoseGraph<Pose>& graph, double& cost) {
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  OptimizeEffort effort;
  effort.iterations = 100;
  StartReport start;
  OptimizeReport report;
  if (!optimizer.assign(graph).ok() || !optimizer.start(start).ok() ||
      !optimizer.optimize(effort, report).ok()) {
    std::puts("no optimum");
  }
  cost = report.final_cost;
  return optimizer.graph().poses;
}

template <typename Pose>
OdometryChain<Pose> chainOf(const PoseGraph<Pose>& graph) {
  const std::vector<std::uint32_t> steps = odometryEdges(graph);
  RobustGraph<Pose> robust({static_cast<std::uint32_t>(graph.poses.size()), 0}, robustGraphSettings<Pose>());
  while (robust.size() < graph.poses.size() && addNextPose(graph, steps, robust).ok()) {
  }
  return robust.odometry();
}

/// What a flight's map does (mapping/loop): a loop is asked when its later pose is there.
template <typename Pose>
Status solveAsFlown(const RobustGraphSettings& settings, PoseGraph<Pose>& graph, RobustSolution& solution) {
  constexpr int kIterations = 3;  // as LoopEffort
  const std::vector<std::uint32_t> steps = odometryEdges(graph);
  solution.is_odometry.assign(graph.edges.size(), false);
  std::vector<std::vector<std::uint32_t>> arriving(graph.poses.size());
  for (const std::uint32_t e : steps) {
    if (e != kNoStep) solution.is_odometry[e] = true;
  }
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    if (solution.is_odometry[e]) continue;
    ++solution.loops;
    arriving[std::max(graph.edges[e].from, graph.edges[e].to)].push_back(e);
  }
  RobustGraph<Pose> robust({static_cast<std::uint32_t>(graph.poses.size()), solution.loops}, settings);
  std::vector<std::uint32_t> ids(graph.edges.size());
  Status status;
  bool moved = false;
  for (std::size_t k = 0; k < graph.poses.size() && status.ok(); ++k) {
    status = addNextPose(graph, steps, robust);
    for (const std::uint32_t e : arriving[k]) {
      if (status.ok()) status = robust.addLoop(graph.edges[e], ids[e]);
    }
    if (status.ok()) status = robust.settle(kIterations, moved);
  }
  if (status.ok()) status = robust.settle(std::numeric_limits<int>::max(), moved);
  for (std::uint32_t e = 0; e < graph.edges.size(); ++e) {
    solution.verdicts.push_back(solution.is_odometry[e] ? LoopVerdict::kSelected : robust.verdict(ids[e]));
  }
  graph.poses = robust.graph().poses;
  return status;
}

/// The optimum's own error, by redrawing all measurements about it.
template <typename Pose>
double expectedError(const PoseGraph<Pose>& graph, const std::vector<Pose>& best) {
  double sum = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(1000 + static_cast<std::uint64_t>(draw));
    PoseGraph<Pose> redrawn = graph;
    redrawn.poses = best;
    for (auto& edge : redrawn.edges) {
      const PoseMatrix<Pose> covariance = covarianceFromInformation(edge.information);
      PoseVector<Pose> normal;
      for (double& x : normal) x = random.normal();
      const Eigen::LLT<PoseMatrix<Pose>> root(covariance);
      const PoseVector<Pose> noise = root.matrixL() * normal;
      edge.T_from_to = best[edge.from].inverse() * best[edge.to] * poseExp(noise);
    }
    double cost = 0;
    const double error = errorOf(optimum(redrawn, cost), positions(best));
    sum += error * error;
  }
  return std::sqrt(sum / kDraws);
}

struct Row {
  double share = 0;
  std::uint32_t true_loops = 0;
  std::uint32_t false_loops = 0;
  double lost = 0;      ///< percent of true
  double rejected = 0;  ///< percent of false
  std::uint32_t false_kept = 0;
  double error = 0;
  double ratio = 0;      ///< to the optimum without false loops
  double own_ratio = 1;  ///< to the same method's result without false loops
  bool solved = false;
  double seconds = 0;
};

template <typename Pose>
struct Case {
  PoseGraph<Pose> graph;  ///< poses: odometry
  std::vector<bool> is_odometry;
  std::uint32_t loops = 0;
  std::vector<Pose> best;                  ///< optimum without false loops
  std::vector<Eigen::Vector3d> reference;  ///< truth, or the optimum
  bool has_truth = false;
  double optimum_error = 0;  ///< against the truth, or the expected one
  double clean_ratio = 1;    ///< of solveRobustly() without false loops

  [[nodiscard]] double ratio(double error) const {
    return has_truth ? error / optimum_error : std::hypot(1, error / optimum_error);
  }

  /// `loops`: where each loop and its fate is written; none where it is closed.
  [[nodiscard]] Row run(const RobustGraphSettings& settings, bool flown, const OutlierInjection& injection,
                        const std::string& label, std::ofstream& loops_out) const {
    Row row;
    PoseGraph<Pose> spoiled = graph;
    if (injection.count > 0 && !injectOutliers(injection, spoiled).ok()) return row;
    row.true_loops = loops;
    row.false_loops = injection.count;
    RobustSolution report;
    Status status;
    row.seconds = 1e-3 * timed([&] {
                    status = flown ? solveAsFlown(settings, spoiled, report)
                                   : solveRobustly(settings, {}, spoiled, report);
                  });
    row.solved = status.ok();
    if (!row.solved) return row;
    std::uint32_t kept = 0;
    for (std::size_t e = 0; e < spoiled.edges.size(); ++e) {
      if (report.is_odometry[e] || report.verdicts[e] != LoopVerdict::kSelected) continue;
      (e < graph.edges.size() ? kept : row.false_kept) += 1;
    }
    row.lost = 100.0 * (loops - kept) / loops;
    row.rejected = injection.count == 0 ? 100 : 100.0 - 100.0 * row.false_kept / injection.count;
    row.error = errorOf(spoiled.poses, reference);
    row.ratio = ratio(row.error);
    row.own_ratio = row.ratio / clean_ratio;
    if (loops_out.is_open()) writeLoops(spoiled, report, label, loops_out);
    return row;
  }

  void writeLoops(const PoseGraph<Pose>& spoiled, const RobustSolution& report, const std::string& label,
                  std::ofstream& out) const {
    const OdometryChain<Pose> chain = chainOf(graph);
    for (std::size_t e = 0; e < spoiled.edges.size(); ++e) {
      if (report.is_odometry[e]) continue;
      const auto& edge = spoiled.edges[e];
      const auto loop = chainLoop(chain, edge);
      if (!loop.withinComponent()) continue;
      const CycleTest gate = odometryTest(chain, loop);
      const auto log10_chance = [&](const CycleTest& test) {
        return logChance<Pose>(test, chain.logBox(loop.to)) / std::log(10.0);
      };
      const Pose solved = spoiled.poses[edge.from].inverse() * spoiled.poses[edge.to];
      const CycleTest own = cycleTest<Pose>(covarianceFromInformation(edge.information),
                                            poseLog(edge.T_from_to.inverse() * solved));
      out << label << ',' << e << ',' << edge.from << ',' << edge.to << ',' << (e >= graph.edges.size())
          << ',' << static_cast<int>(report.verdicts[e]) << ','
          << 2 * edgeCost(edge, best[edge.from], best[edge.to]) << ',' << gate.chi_squared << ','
          << log10_chance(gate) << ',' << own.chi_squared << ',' << log10_chance(own) << '\n';
    }
  }
};

std::string describe(const Row& row) {
  if (!row.solved) return "not solved: too large";
  char text[160];
  std::snprintf(text, sizeof text,
                "rejected %7.3f %% (%u stay), lost %6.2f %%, error %.4f m, ratio %.3f (%.3f), %.1f s",
                row.rejected, row.false_kept, row.lost, row.error, row.ratio, row.own_ratio, row.seconds);
  return text;
}

/// The worst of each figure.
Row worse(Row a, const Row& b) {
  a.lost = std::max(a.lost, b.lost);
  a.rejected = std::min(a.rejected, b.rejected);
  a.error = std::max(a.error, b.error);
  a.ratio = std::max(a.ratio, b.ratio);
  a.own_ratio = std::max(a.own_ratio, b.own_ratio);
  a.solved = a.solved && b.solved;
  a.seconds = std::max(a.seconds, b.seconds);
  return a;
}

/// False with the reason when the graph is left out.
template <typename Pose>
bool qualifies(const PoseGraph<Pose>& given, Case<Pose>& out, std::string& reason) {
  out.graph = given;
  const OdometryChain<Pose> chain = chainOf(given);
  if (chain.size() < given.poses.size()) {
    reason = "no odometry";
    return false;
  }
  const std::vector<std::uint32_t> steps = odometryEdges(given);
  out.is_odometry.assign(given.edges.size(), false);
  for (const std::uint32_t e : steps) {
    if (e != kNoStep) out.is_odometry[e] = true;
  }
  std::uint32_t inside = 0;
  std::uint32_t inside_log = 0;
  const double limit = chiSquaredOfTail(PoseSpace<Pose>::kDof, kCheckTail);
  for (std::size_t e = 0; e < given.edges.size(); ++e) {
    if (out.is_odometry[e]) continue;
    ++out.loops;
    const auto loop = chainLoop(chain, given.edges[e]);
    if (!loop.withinComponent()) continue;
    if (odometryTest(chain, loop).chi_squared <= limit) ++inside_log;
    const Pose Z = chain.pose(loop.from).inverse() * loop.T_chain_loop;
    const PoseTangent<Pose> cycle = relativeError(Z, chain.pose(loop.from), chain.pose(loop.to));
    const PoseMatrix<Pose> C = loop.covariance + chain.covariance(loop.from, loop.to);
    if (cycle.dot(C.llt().solve(cycle)) <= limit) ++inside;
  }
  double cost = 0;
  out.best = optimum(given, cost);
  const double freedom = static_cast<double>(PoseSpace<Pose>::kDof) *
                         static_cast<double>(given.edges.size() + 1 - given.poses.size());
  const double chi = 2 * cost / freedom;
  const double share = out.loops == 0 ? 0 : static_cast<double>(inside) / out.loops;
  char text[160];
  std::snprintf(text, sizeof text,
                "%u loops, chi2/dof %.4g, %.1f %% (%.1f) inside the 99 %% check, %u component(s)", out.loops,
                chi, 100 * share, 100.0 * inside_log / out.loops, chain.components());
  reason = text;
  for (std::uint32_t k = 0; k < chain.size(); ++k) out.graph.poses[k] = chain.pose(k);
  return out.loops >= kLeastLoops && chi >= kLeastChi && chi <= kMostChi && share >= kLeastInside;
}

template <typename Pose>
void refer(const G2oGraph& file, const GraphReference& named, const PoseGraph<Pose>& given, Case<Pose>& out) {
  out.reference = readTruth(named, file);
  out.has_truth = !out.reference.empty();
  if (out.has_truth) {
    out.optimum_error = errorOf(out.best, out.reference);
  } else {
    out.reference = positions(out.best);
    out.optimum_error = expectedError(given, out.best);
  }
}

template <typename Pose>
void runGraph(const G2oGraph& file, const GraphReference& named, const PoseGraph<Pose>& given,
              const Options& options, std::vector<std::string>& table) {
  Case<Pose> graph;
  std::string reason;
  const bool asked = qualifies(given, graph, reason);
  if (!asked && (graph.loops == 0 || !options.all)) {
    std::printf("%-20s left out: %s\n", named.name.c_str(), reason.c_str());
    return;
  }
  refer(file, named, given, graph);
  std::printf("%-20s %s; optimum's error %.4f m (%s)\n", named.name.c_str(), reason.c_str(),
              graph.optimum_error, graph.has_truth ? "truth" : "expected");
  std::ofstream csv;
  std::ofstream loops;
  if (!options.csv.empty()) csv.open(options.csv, std::ios::app);
  if (!options.loops.empty()) loops.open(options.loops, std::ios::app);
  const auto record = [&](const char* method, double share, std::uint64_t seed, const Row& row) {
    if (!csv.is_open()) return;
    csv << named.name << ',' << method << ',' << options.group << ',' << share << ',' << seed << ','
        << row.true_loops << ',' << row.false_loops << ',' << row.solved << ',' << row.rejected << ','
        << row.false_kept << ',' << row.lost << ',' << row.error << ',' << (graph.has_truth ? 't' : 'o')
        << ',' << row.ratio << ',' << row.own_ratio << ',' << row.seconds << std::endl;
  };
  RobustGraphSettings settings = robustGraphSettings<Pose>();
  if (options.max_false > 0) settings.selection.max_false = options.max_false;
  const Row clean = graph.run(settings, options.flown, {}, named.name + ",0,0", loops);
  graph.clean_ratio = clean.ratio;
  std::printf("  %3.0f %%         %s\n", 0.0, describe(clean).c_str());
  std::fflush(stdout);
  record(options.flown ? "flown" : "at once", 0, 0, clean);
  for (const double share : options.shares) {
    Row worst;
    for (std::size_t s = 0; s < options.seeds.size(); ++s) {
      const OutlierInjection injection{outlierCount(graph.loops, share / 100), options.seeds[s],
                                       options.group};
      std::ostringstream label;
      label << named.name << ',' << share << ',' << injection.seed;
      const Row row = graph.run(settings, options.flown, injection, label.str(), loops);
      record(options.flown ? "flown" : "at once", share, injection.seed, row);
      std::printf("  %3.0f %% seed %-3llu %s\n", share, static_cast<unsigned long long>(options.seeds[s]),
                  describe(row).c_str());
      std::fflush(stdout);
      worst = s == 0 ? row : worse(worst, row);
    }
    char line[320];
    std::snprintf(line, sizeof line, "| %s | %u | %u | %.0f | %.2f | %.2f | %.4f %s | %.3f (%.3f) |",
                  named.name.c_str(), worst.true_loops, worst.false_loops, share, worst.rejected, worst.lost,
                  worst.error, graph.has_truth ? "t" : "o", worst.ratio, worst.own_ratio);
    table.emplace_back(line);
  }
}

int run(const Options& options) {
  const std::vector<GraphReference> references = readReferences();
  if (references.empty()) {
    std::puts("no pose_graphs in SWIFTLET_DATA");
    return 1;
  }
  std::vector<std::string> table;
  for (const GraphReference& named : references) {
    const auto& only = options.graphs;
    if (!only.empty() && std::find(only.begin(), only.end(), named.name) == only.end()) continue;
    const G2oFile file = readG2oFile(named.path);
    if (named.space) {
      runGraph(file.graph, named, file.graph.space, options, table);
    } else {
      runGraph(file.graph, named, file.graph.plane, options, table);
    }
  }
  std::puts("\nworst of the seeds:\n");
  std::puts("| graph | true | false | share % | rejected % | lost % | error m | ratio |");
  std::puts("|---|---|---|---|---|---|---|---|");
  for (const std::string& line : table) std::puts(line.c_str());
  return 0;
}

}  // namespace
}  // namespace swiftlet::test

int main(int argc, char** argv) {
  swiftlet::test::Options options;
  CLI::App app("False loops injected into the public pose graphs");
  app.add_option("--graphs", options.graphs, "Only these")->delimiter(',');
  app.add_option("--shares", options.shares, "Percent of all loops")->delimiter(',')->capture_default_str();
  app.add_option("--seeds", options.seeds, "Of the injection")->delimiter(',')->capture_default_str();
  app.add_option("--group", options.group, "False loops that agree with each other")->capture_default_str();
  app.add_flag("--as-flown", options.flown,
               "Poses and loops one by one, three iterations a pose, as in flight; else all loops at once");
  app.add_option("--max-false", options.max_false, "LoopSelectionSettings::max_false; 0: as it is");
  app.add_option("--csv", options.csv, "A row a run is appended to this file");
  app.add_option("--loops", options.loops, "Every loop and its fate is appended to this file");
  app.add_flag("--all", options.all, "Graphs that do not qualify, too");
  CLI11_PARSE(app, argc, argv);
  return swiftlet::test::run(options);
}
