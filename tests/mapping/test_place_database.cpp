// The inverted index against comparing with every keyframe, its policy when full, islands.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <map>
#include <memory>

#include "estimator/core/random.hpp"
#include "mapping/place/place_database.hpp"
#include "mapping/place/vocabulary.hpp"
#include "tests/support/counted_malloc.hpp"

using namespace swiftlet;

namespace {

constexpr std::size_t kWords = 300;

Stamp at(double seconds) { return Stamp{static_cast<std::int64_t>(seconds * 1e9)}; }

/// Up to 40 words near `place`, so that neighbours have words in common.
BagOfWords bagAt(double place, Random& random) {
  std::map<WordId, float> words;
  for (int i = 0; i < 40; ++i) {
    const auto word = static_cast<std::uint32_t>(place) + random.below(40);
    words[word % kWords] += static_cast<float>(random.uniform(0.5, 2));
  }
  float sum = 0;
  for (const auto& w : words) sum += w.second;
  BagOfWords bag;
  for (const auto& [word, value] : words) REQUIRE(bag.tryPushBack({word, value / sum}));
  return bag;
}

struct Kept {
  std::uint64_t index;
  Stamp stamp;
  BagOfWords bag;
};

}  // namespace

TEST_CASE("The index finds what comparing with every keyframe finds, through additions and removals") {
  PlaceDatabaseSettings settings;
  settings.keyframes = 60;
  settings.exclude = 5;
  settings.min_relative = 0;
  settings.per_island = settings.candidates = kMaxPlaceCandidates;
  PlaceDatabase database(kWords, settings);
  Random random(21);
  std::vector<Kept> kept;
  const std::size_t reserved = database.bytes();
#ifdef SWIFTLET_COUNTS_MALLOC
  REQUIRE(test::mallocIsCounted());
#endif
  auto query = std::make_unique<PlaceQuery>();
  for (std::uint64_t i = 0; i < 400; ++i) {
    const Stamp now = at(0.5 * static_cast<double>(i));
    const BagOfWords bag = bagAt(random.uniform(0, kWords), random);
    const long before = test::malloc_calls;
    const Status status = database.query(now, 0, bag, *query);
    std::uint32_t slot = 0;
    const Status added = database.add(i, now, 0, bag, slot);
    REQUIRE(test::malloc_calls == before);
    // Who left is asked of the database; all others must be found with the right score.
    std::vector<std::pair<float, std::uint64_t>> expected;
    for (const Kept& k : kept) {
      const float s = similarity(bag, k.bag);
      if ((now - k.stamp).seconds() >= settings.exclude && s > 0) expected.push_back({s, k.index});
    }
    std::stable_sort(expected.begin(), expected.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    if (status.ok()) {
      for (std::size_t c = 0; c < query->candidates.size() && c < expected.size(); ++c) {
        REQUIRE(query->candidates[c].score == Approx(expected[c].first).margin(1e-5));
      }
      REQUIRE(query->candidates.size() >= std::min(expected.size(), kMaxPlaceCandidates));
    } else {
      REQUIRE(expected.empty());
    }
    kept.push_back({i, now, bag});
    REQUIRE(database.holds(slot, i, 0));
    if (added.code == StatusCode::kCapacityReached) {
      // The one whose lesser similarity to its neighbours is greatest has left.
      float most = -1;
      std::size_t leaver = 0;
      for (std::size_t k = 0; k + 1 < kept.size(); ++k) {
        if ((now - kept[k].stamp).seconds() < settings.exclude) continue;
        float redundancy = 1;
        if (k > 0) redundancy = std::min(redundancy, similarity(kept[k].bag, kept[k - 1].bag));
        if (k + 2 < kept.size()) redundancy = std::min(redundancy, similarity(kept[k].bag, kept[k + 1].bag));
        if (redundancy <= most) continue;
        most = redundancy;
        leaver = k;
      }
      kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(leaver));
    }
    REQUIRE(database.size() == kept.size());
  }
  CHECK(database.counts().removed == 340);
  CHECK(database.bytes() == reserved);
}

TEST_CASE("When postings run out, keyframes leave until the new one fits") {
  PlaceDatabaseSettings settings;
  settings.keyframes = 100;
  settings.postings = 500;
  settings.exclude = 0;
  PlaceDatabase database(kWords, settings);
  Random random(22);
  for (std::uint64_t i = 0; i < 200; ++i) {
    std::uint32_t slot = 0;
    const Status status =
        database.add(i, at(static_cast<double>(i)), 0, bagAt(random.uniform(0, kWords), random), slot);
    REQUIRE((status.ok() || status.code == StatusCode::kCapacityReached));
    REQUIRE(database.holds(slot, i, 0));
  }
  CHECK(database.size() < 30);
  CHECK(database.size() > 10);
  CHECK(database.counts().added == 200);
}

TEST_CASE("A hover thins out first, the places seen once stay") {
  PlaceDatabaseSettings settings;
  settings.keyframes = 50;
  settings.exclude = 2;
  PlaceDatabase database(kWords, settings);
  Random random(23);
  std::vector<std::uint32_t> slots(100);
  for (std::uint64_t i = 0; i < 100; ++i) {
    // Frames 20 to 79 look at one place, the others move on.
    const double place = i < 20   ? 7.0 * static_cast<double>(i)
                         : i < 80 ? 140
                                  : 7.0 * static_cast<double>(i - 60);
    (void)database.add(i, at(0.2 * static_cast<double>(i)), 0, bagAt(place, random), slots[i]);
  }
  int moving = 0;
  for (std::size_t i = 0; i < 20; ++i) moving += database.holds(slots[i], i, 0) ? 1 : 0;
  CHECK(moving >= 18);
}

TEST_CASE("Recent keyframes are no revisit; another epoch's are") {
  PlaceDatabaseSettings settings;
  settings.max_reference = 1;
  PlaceDatabase database(kWords, settings);
  Random random(24);
  auto query = std::make_unique<PlaceQuery>();
  const BagOfWords bag = bagAt(10, random);
  CHECK(database.query(at(0), 0, bag, *query).code == StatusCode::kNotReady);
  std::uint32_t slot = 0;
  REQUIRE(database.add(1, at(0), 0, bag, slot).ok());
  CHECK(database.query(at(9.9), 0, bag, *query).code == StatusCode::kNotReady);
  REQUIRE(database.query(at(10), 0, bag, *query).ok());
  REQUIRE(query->candidates.size() == 1);
  CHECK(query->candidates[0].index == 1);
  CHECK(query->candidates[0].score == Approx(1));
  CHECK(query->candidates[0].relative == Approx(1));
  REQUIRE(database.query(at(1), 1, bag, *query).ok());
  CHECK(query->candidates.size() == 1);
  // What looks much less alike than the predecessor does is no candidate.
  REQUIRE(database.add(2, at(20), 0, bagAt(150, random), slot).ok());
  REQUIRE(database.query(at(31), 0, bagAt(150, random), *query).ok());
  REQUIRE(query->candidates.size() == 1);
  CHECK(query->candidates[0].index == 2);
}

TEST_CASE("Who hovers finds a revisit all the same") {
  const auto bagOf = [](std::initializer_list<WordId> words) {
    BagOfWords bag;
    for (const WordId word : words) REQUIRE(bag.tryPushBack({word, 1.0F / static_cast<float>(words.size())}));
    return bag;
  };
  const BagOfWords old = bagOf({0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  const BagOfWords now = bagOf({0, 1, 100, 101, 102, 103, 104, 105, 106, 107});
  for (const float most : {PlaceDatabaseSettings{}.max_reference, 1.0F}) {
    PlaceDatabaseSettings settings;
    settings.max_reference = most;
    PlaceDatabase database(kWords, settings);
    std::uint32_t slot = 0;
    REQUIRE(database.add(1, at(0), 0, old, slot).ok());
    REQUIRE(database.add(2, at(20), 0, now, slot).ok());
    auto query = std::make_unique<PlaceQuery>();
    REQUIRE(database.query(at(20.1), 0, now, *query).ok());
    CHECK(query->reference == Approx(1));
    CHECK(query->candidates.size() == (most < 1 ? 1 : 0));
  }
}

TEST_CASE("Islands: the best few of each, and how long they are followed") {
  PlaceDatabaseSettings settings;
  settings.per_island = 2;
  PlaceDatabase database(kWords, settings);
  Random random(25);
  std::uint32_t slot = 0;
  // Place 10 is passed at 0 to 4 s and at 20 to 24 s, other places between.
  for (std::uint64_t i = 0; i < 60; ++i) {
    const bool there = i < 9 || (i >= 40 && i < 49);
    (void)database.add(i, at(0.5 * static_cast<double>(i)), 0,
                       bagAt(there ? 10 : 100 + 3.0 * static_cast<double>(i), random), slot);
  }
  auto query = std::make_unique<PlaceQuery>();
  for (int k = 0; k < 4; ++k) {
    REQUIRE(database.query(at(50 + k), 0, bagAt(10, random), *query).ok());
    int first = 0, second = 0;
    for (const PlaceCandidate& c : query->candidates) {
      if (c.index < 9) ++first;
      if (c.index >= 40 && c.index < 49) ++second;
      if (c.index < 9 || (c.index >= 40 && c.index < 49)) CHECK(c.consistent == k);
    }
    CHECK(first == 2);
    CHECK(second == 2);
  }
  // The same with a filter: nothing until an island was followed twice.
  settings.consistent = 2;
  PlaceDatabase strict(kWords, settings);
  for (std::uint64_t i = 0; i < 9; ++i)
    (void)strict.add(i, at(0.5 * static_cast<double>(i)), 0, bagAt(10, random), slot);
  for (int k = 0; k < 4; ++k) {
    REQUIRE(strict.query(at(50 + k), 0, bagAt(10, random), *query).ok());
    CHECK(query->candidates.empty() == (k < 2));
  }
}

TEST_CASE("Bags that do not fit the vocabulary are refused") {
  PlaceDatabase database(10);
  BagOfWords bag;
  REQUIRE(bag.tryPushBack({10, 1.0F}));
  auto query = std::make_unique<PlaceQuery>();
  std::uint32_t slot = 0;
  CHECK(database.add(0, at(0), 0, bag, slot).code == StatusCode::kInvalidInput);
  CHECK(slot == PlaceDatabase::kNoSlot);
  CHECK(database.query(at(0), 0, bag, *query).code == StatusCode::kInvalidInput);
  bag.clear();
  REQUIRE(bag.tryPushBack({3, 0.5F}));
  REQUIRE(bag.tryPushBack({3, 0.5F}));
  CHECK(database.add(0, at(0), 0, bag, slot).code == StatusCode::kInvalidInput);
  bag.clear();
  CHECK(database.add(0, at(0), 0, bag, slot).ok());  // nothing was seen: kept, never found
  CHECK(database.query(at(60), 0, bag, *query).ok());
  CHECK(query->candidates.size() <= 1);
}
