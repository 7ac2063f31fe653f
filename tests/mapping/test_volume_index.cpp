// Keys, the hash against std::map, label counts and the confusion model against direct sums.
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "estimator/core/random.hpp"
#include "mapping/volume/block_hash.hpp"
#include "mapping/volume/block_window.hpp"
#include "mapping/volume/confusion_model.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)

TEST_CASE("keys of blocks are distinct and never zero") {
  std::map<std::uint64_t, BlockIndex> seen;
  for (const std::int32_t x : {-kBlockLimit, -1, 0, 1, kBlockLimit}) {
    for (const std::int32_t y : {-kBlockLimit, -1, 0, 1, kBlockLimit}) {
      for (const std::int32_t z : {-kBlockLimit, -1, 0, 1, kBlockLimit}) {
        const BlockIndex block{x, y, z};
        CHECK(block.inRange());
        CHECK(keyOf(block) != 0);
        CHECK(seen.emplace(keyOf(block), block).second);
      }
    }
  }
  CHECK_FALSE(BlockIndex{kBlockLimit + 1, 0, 0}.inRange());
  CHECK(blockOf({-1, 0, 8}) == BlockIndex{-1, 0, 1});
  CHECK(offsetOf({-1, 0, 8}) == 7);
}

TEST_CASE("the hash does what std::map does") {
  BlockHash hash(400);
  std::map<std::uint64_t, std::uint32_t> oracle;
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    const BlockIndex block{static_cast<std::int32_t>(random.below(12)),
                           static_cast<std::int32_t>(random.below(12)),
                           static_cast<std::int32_t>(random.below(4)) - 2};
    const std::uint64_t key = keyOf(block);
    const auto known = oracle.find(key);
    REQUIRE(hash.find(key) == (known == oracle.end() ? BlockHash::kNone : known->second));
    if (known != oracle.end()) {
      CHECK(hash.erase(key));
      CHECK_FALSE(hash.erase(key));
      oracle.erase(known);
    } else if (oracle.size() < 400) {
      REQUIRE(hash.insert(key, static_cast<std::uint32_t>(i)));
      oracle[key] = static_cast<std::uint32_t>(i);
    }
    REQUIRE(hash.size() == oracle.size());
  }
  for (const auto& [key, slot] : oracle) REQUIRE(hash.find(key) == slot);
}

TEST_CASE("a hash that is full refuses and stays whole") {
  BlockHash hash(8);
  std::uint64_t key = 1;
  while (hash.insert(key, static_cast<std::uint32_t>(key))) ++key;
  CHECK(key == 17);  // all 16 entries
  for (std::uint64_t k = 1; k < key; ++k) CHECK(hash.find(k) == k);
  CHECK(hash.find(key) == BlockHash::kNone);
  CHECK_FALSE(hash.erase(key));
}

TEST_CASE("the window meets every block once, and none outside") {
  BlockWindow window(3);
  CHECK(window.meet({-3, 3, 0}));
  CHECK_FALSE(window.meet({-3, 3, 0}));
  CHECK_FALSE(window.meet({100, 0, 0}));
  CHECK_FALSE(window.meet({0, -100, 0}));
  window.clear();
  CHECK(window.meet({-3, 3, 0}));
}

TEST_CASE("label counts are exact up to four labels, most frequent first") {
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    LabelCounts counts;
    std::map<std::uint8_t, int> oracle;
    const std::uint32_t labels = 1 + random.below(4);
    std::uint8_t best = 0;
    for (int i = 0; i < 60; ++i) {
      const auto label = static_cast<std::uint8_t>(1 + 7 * random.below(labels));
      const bool news = counts.add(label);
      ++oracle[label];
      CHECK(news == (counts.label(0) != best));
      best = counts.label(0);
    }
    int sum = 0;
    for (int slot = 0; slot < LabelCounts::kSlots; ++slot) {
      if (counts.count(slot) == 0) continue;
      REQUIRE(oracle[counts.label(slot)] == counts.count(slot));
      sum += counts.count(slot);
      if (slot > 0) REQUIRE(counts.count(slot) <= counts.count(slot - 1));
    }
    REQUIRE(sum == 60);
  }
}

TEST_CASE("of five labels the rarest gives way, and full counts keep their shares") {
  LabelCounts counts;
  for (int i = 0; i < 10; ++i) (void)counts.add(1);
  for (const std::uint8_t label : {std::uint8_t{2}, std::uint8_t{3}, std::uint8_t{4}})
    (void)counts.add(label);
  (void)counts.add(31);
  CHECK(counts.label(0) == 1);
  CHECK(counts.label(3) == 31);
  LabelCounts full;
  for (int i = 0; i < 1000; ++i) (void)full.add(5);
  for (int i = 0; i < 5000; ++i) {
    (void)full.add(6);
    REQUIRE(full.count(0) <= LabelCounts::kMostCount);
  }
  CHECK(full.label(0) == 6);
  CHECK(full.label(1) == 5);
  CHECK(full.count(1) > 0);
  CHECK(full.count(1) < 500);
}

TEST_CASE("the estimate is Bayes' rule") {
  constexpr int kLabels = 6;
  ConfusionModel::Matrix matrix{};
  Random random(9);
  for (std::size_t real = 1; real < kLabels; ++real) {
    float sum = 0;
    for (std::size_t said = 1; said < kLabels; ++said) {
      matrix[said][real] = static_cast<float>(random.uniform(0.05, 1) + (said == real ? 2 : 0));
      sum += matrix[said][real];
    }
    for (std::size_t said = 1; said < kLabels; ++said) matrix[said][real] /= sum;
  }
  ConfusionModel model;
  REQUIRE(model.set(matrix, kLabels).ok());
  for (int round = 0; round < 300; ++round) {
    LabelCounts counts;
    std::array<int, kLabels> seen{};
    const std::uint32_t first = 1 + random.below(2);
    for (std::uint32_t i = random.below(20) + 1; i > 0; --i) {
      const std::uint32_t label = first + random.below(round % 3 == 0 ? 1 : 4);
      (void)counts.add(static_cast<std::uint8_t>(label));
      ++seen[label];
    }
    std::array<double, kLabels> p{};
    double total = 0;
    for (std::size_t real = 1; real < kLabels; ++real) {
      p[real] = 1;
      for (std::size_t said = 1; said < kLabels; ++said) {
        p[real] *= std::pow(static_cast<double>(matrix[said][real]), seen[said]);
      }
      total += p[real];
    }
    const LabelEstimate estimate = model.estimate(counts);
    const auto best = static_cast<std::size_t>(std::max_element(p.begin() + 1, p.end()) - p.begin());
    // A run of one label only is tabled up to 15.
    const bool tabled = counts.count(1) == 0 && counts.count(0) > 15;
    CHECK(static_cast<double>(estimate.probability) == Approx(p[best] / total).margin(tabled ? 0.02 : 1e-4));
    if (p[best] / total > 0.501) CHECK(estimate.label == best);
  }
  CHECK(model.estimate(LabelCounts{}).label == 0);
}

TEST_CASE("the default model: right nine times of ten") {
  LabelCounts counts;
  (void)counts.add(3);
  const LabelEstimate once = ConfusionModel(11).estimate(counts);
  CHECK(once.label == 3);
  CHECK(once.probability == Approx(0.9F).margin(1e-3));
}

TEST_CASE("a label that the model does not know is not taken for one that it does") {
  const ConfusionModel model(4);
  LabelCounts counts;
  for (int i = 0; i < 5; ++i) counts.add(9);
  CHECK(model.estimate(counts).label == 0);
  CHECK(model.estimate(counts).probability == 0);
  counts.add(2);
  CHECK(model.estimate(counts).label == 2);
  LabelCounts alone;
  alone.add(2);
  CHECK(model.estimate(counts).probability == model.estimate(alone).probability);
}

TEST_CASE("a confusion matrix that is none is refused") {
  ConfusionModel model(4);
  ConfusionModel::Matrix matrix{};
  for (std::size_t i = 1; i < 4; ++i) matrix[i][i] = 1;
  CHECK(model.set(matrix, 4).ok());
  matrix[1][1] = 0.5F;
  CHECK(model.set(matrix, 4).code == StatusCode::kInvalidInput);
  matrix[1][1] = std::nanf("");
  CHECK(model.set(matrix, 4).code == StatusCode::kInvalidInput);
  CHECK(model.set(matrix, 33).code == StatusCode::kInvalidInput);
  CHECK(model.set(matrix, 1).code == StatusCode::kInvalidInput);
}
