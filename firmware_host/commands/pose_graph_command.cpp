#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/lab/modules/pose_graph_run.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kWarningsShown = 10;

void printLoops(const char* name, const LoopCount& count) {
  fmt::print(
      "{:<14} {} selected, {} rejected: {} contradict the odometry, {} inconsistent, {} unsupported, {} "
      "contradict the solution\n",
      name, count.of(LoopVerdict::kSelected), count.rejected(), count.of(LoopVerdict::kAgainstOdometry),
      count.of(LoopVerdict::kInconsistent), count.of(LoopVerdict::kUnsupported),
      count.of(LoopVerdict::kAgainstSolution));
}

void print(const PoseGraphRequest& request, const PoseGraphResult& result) {
  for (std::size_t k = 0; k < std::min(kWarningsShown, result.warnings.size()); ++k) {
    fmt::print(stderr, "warning: {}\n", result.warnings[k]);
  }
  fmt::print("{:<14} {} ({})\n", "poses", result.poses, result.planar ? "plane" : "space");
  fmt::print("{:<14} {}", "edges", result.edges);
  if (result.outliers > 0) fmt::print(", {} of them injected (seed {})", result.outliers, request.seed);
  fmt::print("\n");
  if (result.pieces > 1) fmt::print("{:<14} {}\n", "pieces", result.pieces);
  if (request.robust && result.factored) {
    if (result.robust.components > 1) {
      fmt::print("{:<14} {} pieces (edges between poses that follow each other)\n", "odometry",
                 result.robust.components);
    }
    printLoops(result.outliers > 0 ? "own loops" : "loops", result.loops);
    if (result.outliers > 0) printLoops("injected", result.false_loops);
    if (!result.robust.exact) fmt::print("{:<14} the largest found; a larger one may exist\n", "set");
  }
  fmt::print("{:<14} {:.8g}\n", "cost given", result.start.given_cost);
  if (request.start == StartRule::kAuto && std::isfinite(result.start.chordal_cost))
    fmt::print("{:<14} {:.8g}\n", "cost chordal", result.start.chordal_cost);
  fmt::print("{:<14} {:.8g}\n", "cost initial", result.solve.initial_cost);
  fmt::print("{:<14} {:.8g} (g2o's: 1/2 sum e^T Omega e; chi2 = {:.8g})\n", "cost final",
             result.solve.final_cost, 2 * result.solve.final_cost);
  fmt::print("{:<14} {}{}\n", "iterations", result.solve.iterations,
             result.solve.converged ? "" : ", not converged: raise --iterations");
  fmt::print("{:<14} {:.3f}\n", "seconds", result.seconds);
}

int poseGraph(const PoseGraphRequest& request) {
  const PoseGraphResult result = runPoseGraph(request);
  print(request, result);
  if (!request.loops.empty() && result.factored) fmt::print("loops written to {}\n", request.loops);
  if (!request.out.empty()) fmt::print("written to {}\n", request.out);
  if (result.factored) return kExitDone;
  fmt::print(stderr, "error: {}: {}; the poses are the best found\n", request.file, result.failure);
  return kExitFailed;
}

}  // namespace

void addPoseGraphCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("pose-graph", "Optimize a pose graph from a g2o file");
  auto request = std::make_shared<PoseGraphRequest>();
  command->add_option("FILE", request->file, "Pose graph: .g2o or .g2o.xz")->required();
  command->add_option("--out", request->out, "Optimized graph to write, as g2o text");
  command->add_option("--json", request->json, "File for the results as JSON");
  addChoice<StartRule>(*command, "--start", request->start,
                       "Initial poses: auto uses those with the lower cost: those of the file (of the "
                       "odometry if it has none) or chordal ones",
                       {{"auto", StartRule::kAuto}, {"given", StartRule::kGiven}});
  command->add_option("--iterations", request->iterations, "Maximum number of iterations")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  command
      ->add_option("--inject-outliers", request->outliers,
                   "Number of false loops to add before solving. --out includes them after the file's edges "
                   "(with --robust only those selected)")
      ->check(CLI::Range(0U, 10000000U))
      ->capture_default_str();
  command->add_option("--seed", request->seed, "Seed of the false loops")->capture_default_str();
  command->add_flag("--robust", request->robust,
                    "Select the loops that agree with the odometry, each other and the solution. The others "
                    "are not used and not written to --out");
  command->add_option("--loops", request->loops, "With --robust: CSV of every loop and its verdict");
  command->footer(
      "Costs are g2o's: 1/2 sum e^T Omega e with e = (translation, vec(q)) of T_i_j^-1 T_i^-1 T_j, in 2D\n"
      "(translation, angle). The chi2 that g2o prints is twice the cost. Other programs weigh the 3D "
      "rotation\n"
      "by a factor of 4.\n"
      "Example:\n"
      "  swiftlet pose-graph sphere2500.g2o --out solved.g2o\n"
      "  swiftlet pose-graph torus3D.g2o.xz --out solved.g2o --json solved.json\n"
      "  swiftlet pose-graph intel.g2o --inject-outliers 100 --seed 7 --iterations 0 --out spoiled.g2o\n"
      "  swiftlet pose-graph spoiled.g2o --robust --loops loops.csv --out solved.g2o");
  command->callback([request, &exit_code] { exit_code = poseGraph(*request); });
}

}  // namespace swiftlet
