#pragma once
// Fill-reducing orderings of a symmetric pattern of blocks.
//
// With CHOLMOD: approximate minimum degree (Amestoy, Davis, Duff, SIAM J. Matrix Anal. 1996) and METIS'
// nested dissection (Karypis and Kumar, SIAM J. Sci. Comput. 1998). Without CHOLMOD: only Eigen's minimum
// degree.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/pose_graph/block_structure.hpp"

namespace swiftlet {

enum class BlockOrdering : std::uint8_t { kMinimumDegree, kNestedDissection };

/// order[k] is the k-th block to eliminate. False if the ordering is not available or failed.
bool orderBlocks(BlockOrdering ordering, std::uint32_t blocks, std::span<const BlockPair> pairs,
                 std::vector<std::uint32_t>& order);

}  // namespace swiftlet
