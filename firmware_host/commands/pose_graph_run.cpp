#include "firmware_host/commands/pose_graph_run.hpp"

#include <chrono>
#include <cmath>

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/report/g2o_file.hpp"
#include "firmware_host/report/summary.hpp"
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
void solve(const PoseGraphRequest& request, const std::vector<std::uint32_t>& fixed, PoseGraph<Pose>& graph,
           PoseGraphResult& result) {
  addOutliers(request, graph);
  result.edges = graph.edges.size();
  const auto begin = std::chrono::steady_clock::now();
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
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.factored = status.ok();
  result.failure = status.what;
  graph.poses = optimizer.graph().poses;
}

}  // namespace

PoseGraphResult runPoseGraph(const PoseGraphRequest& request) {
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
    solve(request, file.graph.fixed, file.graph.plane, result);
  } else {
    solve(request, file.graph.fixed, file.graph.space, result);
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
  json["cost_convention"] = "g2o: 1/2 sum e^T Omega e; chi2 = 2 x cost";
  auto& start = json["start"];
  start["choice"] = result.start.choice == StartChoice::kChordal ? "chordal" : "given";
  start["given_cost"] = result.start.given_cost;
  // JSON has no infinity: not computed, or not to be had.
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
