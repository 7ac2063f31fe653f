#pragma once
// `swiftlet pose-graph`: optimizes a g2o file and writes it with the resulting poses, on request without its
// false loops (mapping/pose_graph/robust_solution.hpp).

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "mapping/pose_graph/robust_solution.hpp"

namespace swiftlet {

enum class StartRule : std::uint8_t { kAuto, kGiven };

struct PoseGraphRequest {
  std::string file;
  std::string out;   ///< .g2o; empty: nothing is written
  std::string json;  ///< empty: nothing is written
  StartRule start = StartRule::kAuto;
  int iterations = 100;
  std::uint32_t outliers = 0;  ///< false loops to add before solving
  std::uint64_t seed = 1;
  bool robust = false;
  std::string loops;  ///< with `robust`: CSV of all loops with their verdicts; empty: not written
};

/// Number of loops with each verdict.
struct LoopCount {
  std::array<std::uint32_t, kLoopVerdicts> counts{};

  void add(LoopVerdict verdict) { ++counts[static_cast<std::size_t>(verdict)]; }
  [[nodiscard]] std::uint32_t of(LoopVerdict verdict) const {
    return counts[static_cast<std::size_t>(verdict)];
  }
  [[nodiscard]] std::uint32_t rejected() const {
    return std::accumulate(counts.begin(), counts.end(), 0U) - of(LoopVerdict::kSelected);
  }
};

struct PoseGraphResult {
  bool planar = true;
  std::size_t poses = 0;
  std::size_t edges = 0;  ///< including the false loops, before any is rejected
  std::uint32_t pieces = 0;
  std::uint32_t outliers = 0;
  RobustSolution robust;  ///< with `robust`
  LoopCount loops;        ///< of the file
  LoopCount false_loops;  ///< injected
  StartReport start;
  OptimizeReport solve;      ///< initial_cost: at the chosen start
  double seconds = 0;        ///< wall time of start and optimization, without files
  bool factored = true;      ///< false: the normal equations could not be factored
  const char* failure = "";  ///< the reason in that case
  std::vector<std::string> warnings;
};

/// InputError for bad input. With `robust`, `out` receives the graph without the rejected loops; if there is
/// no solution (`factored` false), the unchanged graph. Deterministic except for `seconds`: equal file and
/// request give an equal output file.
PoseGraphResult runPoseGraph(const PoseGraphRequest& request);

nlohmann::ordered_json toJson(const PoseGraphRequest& request, const PoseGraphResult& result);

}  // namespace swiftlet
