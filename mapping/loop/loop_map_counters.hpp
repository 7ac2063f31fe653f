#pragma once
// Counters of LoopMap, for code that reports them without the map.

#include <cstdint>

#include "mapping/pose_graph/robust_graph_counters.hpp"

namespace swiftlet {

struct LoopMapCounters {
  std::uint64_t nodes_removed = 0;   ///< for room
  std::uint64_t loops_carried = 0;   ///< to the neighbour of a removed node
  std::uint64_t loops_released = 0;  ///< removed for room
  RobustGraphCounters graph;
};

}  // namespace swiftlet
