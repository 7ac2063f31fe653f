// The public benchmark graphs: the best known cost of each, from the poses in its file. SWIFTLET_DATA.

#include <catch2/catch.hpp>

#include "firmware_host/lab/modules/g2o_file.hpp"
#include "mapping/pose_graph/odometry_start.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "tests/mapping/graph_data.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet::test {
namespace {

constexpr double kShare = 1e-3;  // over the best cost
constexpr double kFloor = 1e-6;  // where it is 0

template <typename Pose>
double solve(const PoseGraph<Pose>& graph, OptimizeReport& report) {
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  REQUIRE(optimizer.assign(graph).ok());
  StartReport start;
  REQUIRE(optimizer.start(start).ok());
  REQUIRE(optimizer.optimize({}, report).ok());
  return graphCost(optimizer.graph());
}

void check(const GraphReference& reference, double cost, const OptimizeReport& report) {
  CHECK(report.converged);
  CHECK(report.iterations <= 20);
  CHECK(cost == Approx(report.final_cost).epsilon(1e-9).margin(1e-12));
  CHECK(cost <= reference.best_g2o * (1 + kShare) + kFloor);
  // Far below the best known would be another cost, not a better minimum.
  CHECK(cost >= reference.best_g2o * (1 - kShare) - kFloor);
}

TEST_CASE("every public graph ends at its best known cost") {
  const std::vector<GraphReference> references = readReferences();
  if (references.empty()) {
    skipCase("no pose_graphs in the folder of logs", kRunWithData);
    return;
  }
  CHECK(references.size() >= 30);
  for (const GraphReference& reference : references) {
    INFO(reference.name);
    G2oFile file = readG2oFile(reference.path);
    CHECK(file.graph.poseCount() == reference.poses);
    CHECK(file.graph.edgeCount() == reference.edges);
    CHECK(file.graph.planar != reference.space);
    CHECK(file.report.pieces == 1);
    CHECK((file.report.clamped_information == 5021) == (reference.name == "cubicle"));
    OptimizeReport report;
    const double cost = file.graph.planar ? solve(file.graph.plane, report) : solve(file.graph.space, report);
    check(reference, cost, report);
  }
}

TEST_CASE("graphs on which plain Gauss-Newton goes astray end well from the odometry, too") {
  for (const GraphReference& reference : readReferences()) {
    if (reference.name != "torus3D" && reference.name != "MIT" && reference.name != "input_INTEL_g2o" &&
        reference.name != "M3500_selfnoise_b") {
      continue;
    }
    INFO(reference.name);
    G2oFile file = readG2oFile(reference.path);
    OptimizeReport report;
    double cost = 0;
    if (file.graph.planar) {
      odometryStart(file.graph.plane);
      cost = solve(file.graph.plane, report);
    } else {
      odometryStart(file.graph.space);
      cost = solve(file.graph.space, report);
    }
    check(reference, cost, report);
  }
}

}  // namespace
}  // namespace swiftlet::test
