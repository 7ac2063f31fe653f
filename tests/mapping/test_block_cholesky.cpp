// The sparse factorization beside a dense one, on random patterns.

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <numeric>
#include <set>

#include "estimator/core/random.hpp"
#include "mapping/pose_graph/block_cholesky.hpp"

namespace swiftlet::test {
namespace {

std::vector<BlockPair> randomPairs(Random& random, std::uint32_t blocks, std::uint32_t more, bool chain) {
  std::set<BlockPair> found;
  for (std::uint32_t k = 1; chain && k < blocks; ++k) found.insert({k - 1, k});
  for (std::uint32_t k = 0; k < more && blocks > 1; ++k) {
    const std::uint32_t a = random.below(blocks);
    const std::uint32_t b = random.below(blocks);
    if (a != b) found.insert(std::minmax(a, b));
  }
  std::vector<BlockPair> pairs(found.begin(), found.end());
  for (BlockPair& pair : pairs) {
    if (random.below(2) == 0) std::swap(pair.first, pair.second);
  }
  return pairs;
}

template <int kBlock>
struct Example {
  BlockMatrix<kBlock> matrix;
  Eigen::MatrixXd dense;
};

template <int kBlock>
Example<kBlock> randomMatrix(Random& random, std::uint32_t blocks, const std::vector<BlockPair>& pairs) {
  Example<kBlock> example;
  example.matrix.reset(blocks, pairs.size());
  example.dense = Eigen::MatrixXd::Identity(blocks * kBlock, blocks * kBlock);
  for (const auto& [a, b] : pairs) {
    // J^T J of a random J over the two blocks.
    Eigen::Matrix<double, kBlock, 2 * kBlock> J;
    for (Eigen::Index k = 0; k < J.size(); ++k) J.data()[k] = random.normal();
    const auto left = J.template leftCols<kBlock>();
    const auto right = J.template rightCols<kBlock>();
    example.dense.template block<kBlock, kBlock>(a * kBlock, a * kBlock) += left.transpose() * left;
    example.dense.template block<kBlock, kBlock>(b * kBlock, b * kBlock) += right.transpose() * right;
    example.dense.template block<kBlock, kBlock>(a * kBlock, b * kBlock) += left.transpose() * right;
    example.dense.template block<kBlock, kBlock>(b * kBlock, a * kBlock) += right.transpose() * left;
  }
  for (std::uint32_t k = 0; k < blocks; ++k) {
    example.matrix.diagonal[k] = example.dense.template block<kBlock, kBlock>(k * kBlock, k * kBlock);
  }
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    example.matrix.pairs[k] =
        example.dense.template block<kBlock, kBlock>(pairs[k].first * kBlock, pairs[k].second * kBlock);
  }
  return example;
}

template <int kBlock>
void checkSolves(std::uint64_t seed, std::uint32_t blocks, std::uint32_t more, bool chain) {
  Random random(seed);
  const std::vector<BlockPair> pairs = randomPairs(random, blocks, more, chain);
  const Example<kBlock> example = randomMatrix<kBlock>(random, blocks, pairs);
  BlockStructure structure;
  structure.analyze(blocks, pairs);
  REQUIRE(structure.blocks() == blocks);
  BlockCholesky<kBlock> cholesky;
  cholesky.prepare(structure);
  Eigen::MatrixXd right(blocks * kBlock, 3);
  for (Eigen::Index k = 0; k < right.size(); ++k) right.data()[k] = random.normal();
  // The second factorization uses the first one's memory; the third is damped.
  for (int round = 0; round < 3; ++round) {
    Eigen::VectorXd damping;
    if (round == 2) damping = Eigen::VectorXd::LinSpaced(right.rows(), 0.5, 2.0);
    REQUIRE(cholesky.factor(example.matrix, damping));
    Eigen::MatrixXd dense = example.dense;
    if (round == 2) dense.diagonal() += damping;
    Eigen::MatrixXd x = right;
    cholesky.solve(x);
    CHECK((dense * x - right).norm() < 1e-10 * right.norm());
  }
}

TEST_CASE("sparse block solves agree with dense ones") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const auto size = static_cast<std::uint32_t>(1 + seed * 5);
    checkSolves<1>(seed, size, 2 * size, false);
    checkSolves<2>(seed, size, size, true);
    checkSolves<3>(seed, size, size / 2, true);
    checkSolves<6>(seed, size, size, seed % 2 == 0);
  }
  checkSolves<3>(21, 300, 30, true);   // long narrow fronts
  checkSolves<6>(22, 80, 800, false);  // one wide front
  checkSolves<3>(23, 40, 0, false);    // no pairs at all
}

TEST_CASE("a structure's nodes are postordered and its rows belong to ancestors") {
  Random random(5);
  const std::uint32_t blocks = 200;
  const std::vector<BlockPair> pairs = randomPairs(random, blocks, 150, true);
  BlockStructure structure;
  structure.analyze(blocks, pairs);
  std::uint32_t column = 0;
  const auto nodes = structure.nodes();
  for (std::uint32_t k = 0; k < nodes.size(); ++k) {
    CHECK(nodes[k].first_column == column);
    column += nodes[k].columns;
    for (std::uint32_t r = 0; r < nodes[k].rows; ++r) {
      const std::uint32_t place = structure.rows()[nodes[k].rows_begin + r];
      CHECK(place >= column);
      if (r > 0) CHECK(place > structure.rows()[nodes[k].rows_begin + r - 1]);
    }
    if (nodes[k].rows > 0) CHECK(nodes[k].parent > k);
  }
  CHECK(column == blocks);
  std::set<std::uint32_t> places;
  for (std::uint32_t k = 0; k < blocks; ++k) places.insert(structure.place(k));
  CHECK(places.size() == blocks);
}

TEST_CASE("a matrix that is not positive definite is found out") {
  Random random(7);
  const std::vector<BlockPair> pairs = randomPairs(random, 30, 30, true);
  Example<3> example = randomMatrix<3>(random, 30, pairs);
  BlockStructure structure;
  structure.analyze(30, pairs);
  BlockCholesky<3> cholesky;
  cholesky.prepare(structure);
  REQUIRE(cholesky.factor(example.matrix, {}));
  example.matrix.diagonal[17](1, 1) = -1;
  CHECK_FALSE(cholesky.factor(example.matrix, {}));
  example.matrix.diagonal[17](1, 1) = std::nan("");
  CHECK_FALSE(cholesky.factor(example.matrix, {}));
}

TEST_CASE("the same pattern is ordered the same way") {
  Random random(9);
  const std::vector<BlockPair> pairs = randomPairs(random, 120, 100, true);
  BlockStructure a;
  BlockStructure b;
  a.analyze(120, pairs);
  b.analyze(120, pairs);
  for (std::uint32_t k = 0; k < 120; ++k) CHECK(a.place(k) == b.place(k));
}

}  // namespace
}  // namespace swiftlet::test
