#include "mapping/pose_graph/block_ordering.hpp"

#ifdef SWIFTLET_WITH_CHOLMOD
#include <cholmod.h>
#else
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#endif

#include <algorithm>

namespace swiftlet {

#ifdef SWIFTLET_WITH_CHOLMOD
namespace {

/// CHOLMOD's workspace, freed at the end.
class Workspace {
 public:
  Workspace() { cholmod_start(&common_); }
  ~Workspace() { cholmod_finish(&common_); }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
  cholmod_common* get() { return &common_; }

 private:
  cholmod_common common_{};
};

}  // namespace

bool orderBlocks(BlockOrdering ordering, std::uint32_t blocks, std::span<const BlockPair> pairs,
                 std::vector<std::uint32_t>& order) {
  // The upper triangle by columns, as CHOLMOD takes a symmetric pattern.
  std::vector<int> column(blocks + 1, 0);
  std::vector<int> row(pairs.size());
  for (const auto& [a, b] : pairs) ++column[std::max(a, b) + 1];
  for (std::uint32_t k = 0; k < blocks; ++k) column[k + 1] += column[k];
  std::vector<int> next(column.begin(), column.end() - 1);
  for (const auto& [a, b] : pairs) {
    row[static_cast<std::size_t>(next[std::max(a, b)]++)] = static_cast<int>(std::min(a, b));
  }
  cholmod_sparse pattern{};
  pattern.nrow = blocks;
  pattern.ncol = blocks;
  pattern.nzmax = row.size();
  pattern.p = column.data();
  pattern.i = row.data();
  pattern.stype = 1;
  pattern.itype = CHOLMOD_INT;
  pattern.xtype = CHOLMOD_PATTERN;
  pattern.sorted = 0;
  pattern.packed = 1;
  Workspace workspace;
  workspace.get()->print = 0;
  std::vector<int> permutation(blocks);
  const bool done = ordering == BlockOrdering::kMinimumDegree
                        ? cholmod_amd(&pattern, nullptr, 0, permutation.data(), workspace.get()) != 0
                        : cholmod_metis(&pattern, nullptr, 0, 0, permutation.data(), workspace.get()) != 0;
  if (!done) return false;
  order.assign(permutation.begin(), permutation.end());
  return true;
}

#else

bool orderBlocks(BlockOrdering ordering, std::uint32_t blocks, std::span<const BlockPair> pairs,
                 std::vector<std::uint32_t>& order) {
  if (ordering != BlockOrdering::kMinimumDegree) return false;
  std::vector<Eigen::Triplet<double> > entries;
  for (std::uint32_t k = 0; k < blocks; ++k) entries.emplace_back(k, k, 1.0);
  for (const auto& [a, b] : pairs) {
    entries.emplace_back(a, b, 1.0);
    entries.emplace_back(b, a, 1.0);
  }
  Eigen::SparseMatrix<double> pattern(blocks, blocks);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::AMDOrdering<int>::PermutationType permutation;
  Eigen::AMDOrdering<int>()(pattern, permutation);
  order.resize(blocks);
  for (std::uint32_t k = 0; k < blocks; ++k) order[k] = static_cast<std::uint32_t>(permutation.indices()[k]);
  return true;
}

#endif

}  // namespace swiftlet
