#include "firmware_host/lab/modules/pose_graph_run.hpp"

#include <chrono>
#include <cmath>
#include <sstream>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/modules/g2o_file.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "mapping/pose_graph/outlier_injection.hpp"

namespace swiftlet {
namespace {

template <typename Pose>
void addOutliers(const PoseGraphRequest& request, PoseGraph<Pose>& graph) {
  if (request.outliers == 0) return;
  OutlierInjection injection;
  injection.count = request.outliers;
  injection.seed = request.seed;
  if (const Status status = injectOutliers(injection, graph); !status.ok()) {
    throw InputError(request.file, 0, "--inject-outliers", status.what, "Give a larger graph");
  }
}

template <typename Pose>
Status solvePlainly(const PoseGraphRequest& request, const std::vector<std::uint32_t>& fixed,
                    PoseGraph<Pose>& graph, PoseGraphResult& result) {
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  Status status = optimizer.assign(graph);
  for (const std::uint32_t pose : fixed) {
    if (status.ok()) status = optimizer.hold(pose, true);
  }
  if (status.ok() && request.start == StartRule::kAuto) status = optimizer.start(result.start);
  if (request.start == StartRule::kGiven) result.start.given_cost = optimizer.cost();
  OptimizeEffort effort;
  effort.iterations = request.iterations;
  if (status.ok()) status = optimizer.optimize(effort, result.solve);
  graph.poses = optimizer.graph().poses;
  return status;
}

template <typename Pose>
void writeLoops(const PoseGraphRequest& request, const std::vector<std::int64_t>& ids,
                const PoseGraph<Pose>& graph, std::size_t own_edges, const RobustSolution& solution) {
  std::ostringstream csv;
  csv << "edge,from_id,to_id,verdict,injected\n";
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    if (solution.is_odometry[e]) continue;
    csv << e << ',' << ids[graph.edges[e].from] << ',' << ids[graph.edges[e].to] << ','
        << verdictName(solution.verdicts[e]) << ',' << (e >= own_edges ? 1 : 0) << '\n';
  }
  writeWholeFile(request.loops, csv.str());
}

/// Solves without the rejected loops.
template <typename Pose>
Status solveWithoutFalse(const PoseGraphRequest& request, const G2oGraph& file, std::size_t own_edges,
                         PoseGraph<Pose>& graph, PoseGraphResult& result) {
  RobustGraphSettings settings = robustGraphSettings<Pose>();
  settings.effort.iterations = request.iterations;
  const Status status = solveRobustly(settings, file.fixed, graph, result.robust);
  result.start = result.robust.start;
  result.solve = result.robust.solve;
  if (!status.ok()) return status;
  if (!request.loops.empty()) writeLoops(request, file.ids, graph, own_edges, result.robust);
  std::vector<RelativePose<Pose>> left;
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    const LoopVerdict verdict = result.robust.verdicts[e];
    if (!result.robust.is_odometry[e]) (e < own_edges ? result.loops : result.false_loops).add(verdict);
    if (verdict == LoopVerdict::kSelected) left.push_back(graph.edges[e]);
  }
  graph.edges.swap(left);
  return status;
}

template <typename Pose>
void solve(const PoseGraphRequest& request, const G2oGraph& file, PoseGraph<Pose>& graph,
           PoseGraphResult& result) {
  const std::size_t own_edges = graph.edges.size();
  addOutliers(request, graph);
  result.edges = graph.edges.size();
  const auto begin = std::chrono::steady_clock::now();
  const Status status = request.robust ? solveWithoutFalse(request, file, own_edges, graph, result)
                                       : solvePlainly(request, file.fixed, graph, result);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.factored = status.ok();
  result.failure = status.what;
}

nlohmann::ordered_json toJson(const LoopCount& count) {
  nlohmann::ordered_json json = {{"selected", count.of(LoopVerdict::kSelected)},
                                 {"rejected", count.rejected()}};
  for (const LoopVerdict verdict : {LoopVerdict::kAgainstOdometry, LoopVerdict::kInconsistent,
                                    LoopVerdict::kUnsupported, LoopVerdict::kAgainstSolution}) {
    json[verdictName(verdict)] = count.of(verdict);
  }
  return json;
}

}  // namespace

PoseGraphResult runPoseGraph(const PoseGraphRequest& request) {
  if (request.robust && request.start == StartRule::kGiven) {
    throw InputError(request.file, 0, "--start", "the given poses may contain the false loops",
                     "Omit --start with --robust");
  }
  if (!request.robust && !request.loops.empty()) {
    throw InputError(request.file, 0, "--loops", "no loop is rejected", "Add --robust");
  }
  G2oFile file = readG2oFile(request.file);
  PoseGraphResult result;
  result.planar = file.graph.planar;
  result.poses = file.graph.poseCount();
  result.pieces = file.report.pieces;
  result.outliers = request.outliers;
  for (const G2oMessage& warning : file.report.warnings) {
    result.warnings.push_back(warningText(request.file, warning));
  }
  if (file.graph.planar) {
    solve(request, file.graph, file.graph.plane, result);
  } else {
    solve(request, file.graph, file.graph.space, result);
  }
  if (!request.out.empty()) writeG2oFile(request.out, file.graph);
  if (!request.json.empty()) writeJson(request.json, toJson(request, result));
  return result;
}

nlohmann::ordered_json toJson(const PoseGraphRequest& request, const PoseGraphResult& result) {
  nlohmann::ordered_json json;
  json["file"] = request.file;
  json["out"] = request.out;
  json["space"] = result.planar ? "plane" : "space";
  json["poses"] = result.poses;
  json["edges"] = result.edges;
  json["pieces"] = result.pieces;
  json["injected_outliers"] = {{"count", result.outliers}, {"seed", request.seed}};
  if (request.robust) {
    auto& robust = json["robust"];
    robust["loops"] = result.robust.loops;
    robust["odometry_components"] = result.robust.components;
    robust["agree_with_odometry"] = result.robust.passed;
    robust["selected"] = result.robust.selected;
    robust["largest_set_proven"] = result.robust.exact;
    robust["own"] = toJson(result.loops);
    robust["injected"] = toJson(result.false_loops);
  }
  json["cost_convention"] = "g2o: 1/2 sum e^T Omega e; chi2 = 2 x cost";
  auto& start = json["start"];
  start["choice"] = result.start.choice == StartChoice::kChordal ? "chordal" : "given";
  start["given_cost"] = result.start.given_cost;
  // JSON has no infinity: null if it was not computed or is not available.
  const bool chordal = request.start == StartRule::kAuto && std::isfinite(result.start.chordal_cost);
  start["chordal_cost"] = chordal ? nlohmann::ordered_json(result.start.chordal_cost) : nullptr;
  json["initial_cost"] = result.solve.initial_cost;
  json["final_cost"] = result.solve.final_cost;
  json["iterations"] = result.solve.iterations;
  json["rejected_steps"] = result.solve.rejected;
  json["converged"] = result.solve.converged;
  json["seconds"] = result.seconds;
  json["warnings"] = result.warnings;
  json["version"] = versionJson();
  return json;
}

}  // namespace swiftlet
