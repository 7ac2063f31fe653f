// All graphs of SWIFTLET_DATA/pose_graphs: CPU time until the cost is within 0.1 % of the best known one,
// ours from the file beside Ceres from the file (and from our start), and to convergence; then the
// factorization alone beside CHOLMOD's.
//   benchmark_pose_graph [GRAPH...]

#include <Eigen/CholmodSupport>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "firmware_host/lab/modules/g2o_file.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "tests/benchmark/pose_graph_ceres.hpp"
#include "tests/mapping/graph_data.hpp"
#include "tests/support/cpu_time.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet::test {
namespace {

constexpr int kRepeats = 3;          // the fastest counts
constexpr double kGoalShare = 1e-3;  // above the best cost
constexpr double kGoalFloor = 1e-6;  // where the best cost is 0
constexpr double kSlow = 1000;       // ms; a run that takes longer is not repeated
constexpr int kMaxIterations = 100;

struct OurRun {
  double reach_ms = std::numeric_limits<double>::infinity();
  double total_ms = 0;
  double final_cost = 0;
  int iterations = 0;
  bool chordal = false;
};

struct Row {
  OurRun ours;
  CeresRun from_file;
  CeresRun from_chordal;
};

/// Everything counts: taking the graph over, ordering, start, iterations.
template <typename Pose>
OurRun solveOurs(const PoseGraph<Pose>& graph, double goal, PoseGraph<Pose>& start) {
  OurRun run;
  const double begin = cpuMilliseconds();
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  StartReport report;
  if (!optimizer.assign(graph).ok() || !optimizer.start(report).ok()) return run;
  run.chordal = report.choice == StartChoice::kChordal;
  double copying = cpuMilliseconds();
  start = optimizer.graph();
  copying = cpuMilliseconds() - copying;
  OptimizeEffort effort;
  effort.iterations = 1;
  OptimizeReport step;
  while (run.iterations < kMaxIterations && !step.converged) {
    if (!optimizer.optimize(effort, step).ok()) break;
    ++run.iterations;
    const double now = cpuMilliseconds() - begin - copying;
    if (step.final_cost <= goal) run.reach_ms = std::min(run.reach_ms, now);
    run.total_ms = now;
  }
  run.final_cost = step.final_cost;
  return run;
}

/// The better of Ceres' two strategies, and of the repeats.
template <typename Pose>
CeresRun bestOfCeres(const PoseGraph<Pose>& graph, double goal) {
  CeresRun best;
  for (const CeresSteps steps : {CeresSteps::kLevenberg, CeresSteps::kDogleg}) {
    for (int k = 0; k < kRepeats; ++k) {
      const CeresRun run = solveWithCeres(graph, goal, steps);
      const bool better =
          best.iterations == 0 || (run.reached && (!best.reached || run.cpu_ms < best.cpu_ms));
      if (better) best = run;
      if (!run.reached || run.cpu_ms > kSlow) break;
    }
  }
  return best;
}

template <typename Pose>
Row measure(const PoseGraph<Pose>& graph, double best_cost) {
  const double goal = std::max(best_cost * (1 + kGoalShare), kGoalFloor);
  Row row;
  PoseGraph<Pose> start;
  for (int k = 0; k < kRepeats; ++k) {
    const OurRun run = solveOurs(graph, goal, start);
    if (k == 0 || run.reach_ms < row.ours.reach_ms) row.ours = run;
  }
  row.from_file = bestOfCeres(graph, goal);
  row.from_chordal = bestOfCeres(start, goal);
  return row;
}

/// A positive definite matrix with the graph's pattern.
template <int kBlock>
BlockMatrix<kBlock> exampleMatrix(const GraphLayout& layout) {
  BlockMatrix<kBlock> matrix;
  matrix.reset(layout.unknowns, layout.pairs.size());
  for (auto& block : matrix.diagonal) block = BlockMatrix<kBlock>::Block::Identity();
  for (std::size_t k = 0; k < layout.pairs.size(); ++k) {
    auto& block = matrix.pairs[k];
    for (int i = 0; i < kBlock * kBlock; ++i) {
      block(i / kBlock, i % kBlock) = 0.1 * ((static_cast<int>(k) * 7 + i * 5) % 11 - 5);
    }
    for (const std::uint32_t end : {layout.pairs[k].first, layout.pairs[k].second}) {
      matrix.diagonal[end].diagonal().array() += kBlock;
    }
  }
  return matrix;
}

template <int kBlock>
Eigen::SparseMatrix<double> toSparse(const GraphLayout& layout, const BlockMatrix<kBlock>& matrix) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](std::uint32_t row, std::uint32_t column, const auto& block) {
    for (int i = 0; i < kBlock; ++i) {
      for (int j = 0; j < kBlock; ++j) {
        const int r = static_cast<int>(row) * kBlock + i;
        const int c = static_cast<int>(column) * kBlock + j;
        if (r >= c) entries.emplace_back(r, c, block(i, j));
      }
    }
  };
  for (std::uint32_t k = 0; k < layout.unknowns; ++k) add(k, k, matrix.diagonal[k]);
  for (std::size_t k = 0; k < layout.pairs.size(); ++k) {
    add(layout.pairs[k].second, layout.pairs[k].first, matrix.pairs[k].transpose());
  }
  const auto size = static_cast<Eigen::Index>(layout.unknowns) * kBlock;
  Eigen::SparseMatrix<double> sparse(size, size);
  sparse.setFromTriplets(entries.begin(), entries.end());
  return sparse;
}

struct FactorTimes {
  double analyze_ms = 0, factor_ms = 0, cholmod_analyze_ms = 0, cholmod_factor_ms = 0;
};

template <typename Pose>
FactorTimes measureFactors(const PoseGraph<Pose>& graph) {
  constexpr int kDof = PoseSpace<Pose>::kDof;
  FactorTimes times;
  std::vector<BlockPair> ends;
  for (const auto& edge : graph.edges) ends.emplace_back(edge.from, edge.to);
  GraphLayout layout;
  const std::vector<bool> none(graph.poses.size(), false);
  times.analyze_ms = timed([&] { layout.arrange(graph.poses.size(), ends, none, none); });
  const BlockMatrix<kDof> matrix = exampleMatrix<kDof>(layout);
  BlockCholesky<kDof> ours;
  ours.prepare(layout.structure);
  const Eigen::SparseMatrix<double> sparse = toSparse(layout, matrix);
  Eigen::CholmodDecomposition<Eigen::SparseMatrix<double>, Eigen::Lower> cholmod;
  times.cholmod_analyze_ms = timed([&] { cholmod.analyzePattern(sparse); });
  times.factor_ms = times.cholmod_factor_ms = std::numeric_limits<double>::infinity();
  bool good = true;
  for (int k = 0; k < kRepeats; ++k) {
    times.factor_ms = std::min(times.factor_ms, timed([&] { good = ours.factor(matrix, {}) && good; }));
    times.cholmod_factor_ms = std::min(times.cholmod_factor_ms, timed([&] { cholmod.factorize(sparse); }));
  }
  if (!good || cholmod.info() != Eigen::Success) std::printf("a factorization failed\n");
  return times;
}

void print(const GraphReference& reference, const Row& row, std::vector<double>& ratios,
           std::vector<double>& chordal_ratios) {
  const CeresRun& counted = row.from_file.reached ? row.from_file : row.from_chordal;
  const double ratio = counted.cpu_ms / row.ours.reach_ms;
  const double chordal_ratio = row.from_chordal.cpu_ms / row.ours.reach_ms;
  ratios.push_back(ratio);
  chordal_ratios.push_back(chordal_ratio);
  std::printf("%-24s %6zu %6zu | %-7s %8.2f %8.2f %3d %14.8g %9.1e | ", reference.name.c_str(),
              reference.poses, reference.edges, row.ours.chordal ? "chordal" : "given", row.ours.reach_ms,
              row.ours.total_ms, row.ours.iterations, row.ours.final_cost,
              reference.best_g2o > 0 ? row.ours.final_cost / reference.best_g2o - 1 : row.ours.final_cost);
  if (row.from_file.reached) {
    std::printf("%9.2f %3d", row.from_file.cpu_ms, row.from_file.iterations);
  } else {
    std::printf("%9s %3s", "never", "");
  }
  std::printf(" %9.2f %3d | %6.1f %6.1f\n", row.from_chordal.cpu_ms, row.from_chordal.iterations, ratio,
              chordal_ratio);
  std::fflush(stdout);
}

int run(const std::vector<std::string>& wanted) {
  std::vector<GraphReference> references = readReferences();
  if (references.empty()) {
    std::printf("no graphs: set SWIFTLET_DATA to the folder that holds pose_graphs\n");
    return 1;
  }
  if (!wanted.empty()) {
    std::erase_if(references, [&](const GraphReference& reference) {
      return std::find(wanted.begin(), wanted.end(), reference.name) == wanted.end();
    });
  }
  std::printf(
      "CPU ms to a cost within 0.1 %% of the best (fastest of %d); ours with ordering and start, Ceres "
      "without "
      "building its problem\n",
      kRepeats);
  std::printf("%-24s %6s %6s | %-7s %8s %8s %3s %14s %9s | %9s %3s %9s %3s | %6s %6s\n", "graph", "poses",
              "edges", "start", "reach", "converge", "it", "final cost", "over best", "Ceres", "it",
              "chordal", "it", "ratio", "(chord)");
  std::vector<double> ratios;
  std::vector<double> chordal_ratios;
  std::vector<std::pair<std::string, FactorTimes>> factors;
  for (const GraphReference& reference : references) {
    const G2oFile file = readG2oFile(reference.path);
    const Row row = file.graph.planar ? measure(file.graph.plane, reference.best_g2o)
                                      : measure(file.graph.space, reference.best_g2o);
    print(reference, row, ratios, chordal_ratios);
    factors.emplace_back(reference.name, file.graph.planar ? measureFactors(file.graph.plane)
                                                           : measureFactors(file.graph.space));
  }
  std::printf(
      "ratio Ceres / ours: least %.2f, median %.2f; Ceres given our start for nothing: least %.2f, median "
      "%.2f\n\n",
      quantile(ratios, 0), quantile(ratios, 0.5), quantile(chordal_ratios, 0), quantile(chordal_ratios, 0.5));
  std::printf("%-24s %10s %10s | %10s %10s | %6s   CPU ms\n", "graph", "analyze", "factor", "CHOLMOD a.",
              "factor", "ratio");
  for (const auto& [name, times] : factors) {
    std::printf("%-24s %10.2f %10.2f | %10.2f %10.2f | %6.1f\n", name.c_str(), times.analyze_ms,
                times.factor_ms, times.cholmod_analyze_ms, times.cholmod_factor_ms,
                times.cholmod_factor_ms / times.factor_ms);
  }
  return 0;
}

}  // namespace
}  // namespace swiftlet::test

int main(int argc, char** argv) { return swiftlet::test::run({argv + 1, argv + argc}); }
