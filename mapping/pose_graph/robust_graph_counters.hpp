#pragma once
// Counters of RobustGraph, for code that reports them without the graph. Step numbers: robust_graph.hpp.

#include <cstdint>

namespace swiftlet {

struct RobustGraphCounters {
  std::uint64_t optimizations = 0;        ///< calls of the optimizer
  std::uint64_t graduated_solutions = 0;  ///< of these, in 4
  std::uint64_t reconsidered = 0;         ///< loops compared with a solution in 5
  std::uint64_t taken_back = 0;           ///< of these, accepted
};

}  // namespace swiftlet
