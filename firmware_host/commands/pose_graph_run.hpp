#pragma once
// `swiftlet pose-graph`: a g2o file optimized, and written again with the poses found.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "mapping/pose_graph/pose_graph_optimizer.hpp"

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
};

struct PoseGraphResult {
  bool planar = true;
  std::size_t poses = 0;
  std::size_t edges = 0;  ///< with the false loops
  std::uint32_t pieces = 0;
  std::uint32_t outliers = 0;
  StartReport start;
  OptimizeReport solve;      ///< initial_cost: at the start that was chosen
  double seconds = 0;        ///< wall time of start and optimization, without files
  bool factored = true;      ///< false: the normal equations could not be factored
  const char* failure = "";  ///< what then
  std::vector<std::string> warnings;
};

/// InputError for bad input. Deterministic but for `seconds`: the same file and request, the same output
/// file.
PoseGraphResult runPoseGraph(const PoseGraphRequest& request);

nlohmann::ordered_json toJson(const PoseGraphRequest& request, const PoseGraphResult& result);

}  // namespace swiftlet
