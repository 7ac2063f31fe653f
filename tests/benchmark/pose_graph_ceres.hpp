#pragma once
// Pose graphs in Ceres: the same cost with the same closed-form Jacobians, whitened by the square roots of
// the information matrices. Its best setting for such graphs: one parameter block a pose,
// SPARSE_NORMAL_CHOLESKY on SuiteSparse, one thread.

#include <vector>

#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet::test {

enum class CeresSteps { kLevenberg, kDogleg };

struct CeresRun {
  bool reached = false;  ///< a cost at or below the goal
  double cpu_ms = 0;     ///< of Solve() until then; the building of the problem is not counted
  int iterations = 0;
  double final_cost = 0;
};

/// From `graph.poses`, pose 0 held, until the cost is at most `goal` or Ceres stops by itself.
template <typename Pose>
CeresRun solveWithCeres(const PoseGraph<Pose>& graph, double goal, CeresSteps steps);

}  // namespace swiftlet::test
