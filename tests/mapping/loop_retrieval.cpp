#include "tests/mapping/loop_retrieval.hpp"

#include <algorithm>
#include <cstdio>

namespace swiftlet::loop_sets {
namespace {

// What comes of the first `most` candidates of every image, each verified until one is accepted (`first`),
// or all of them.
struct Yield {
  std::size_t images = 0, closed = 0, false_ones = 0, verified = 0, pairs = 0;
};

double share(std::size_t part, std::size_t all) {
  return static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(all, 1));
}

}  // namespace

std::vector<PlaceQuery> retrieve(const ImageSet& set, const std::vector<PlaceKeyframe>& keyframes,
                                 const Vocabulary& vocabulary, const PlaceDatabaseSettings& settings) {
  PlaceDatabase database(vocabulary.words(), settings);
  std::vector<PlaceQuery> found(keyframes.size());
  BagOfWords bag;
  for (std::size_t j = 0; j < keyframes.size(); ++j) {
    const Stamp stamp = Stamp{} + Duration::fromSeconds(set.shots[j].seconds - set.shots[0].seconds);
    std::uint32_t slot = 0;
    (void)vocabulary.describe(keyframes[j], bag);
    (void)database.query(stamp, 0, bag, found[j]);
    (void)database.add(j, stamp, 0, bag, slot);
  }
  return found;
}

const char* describe(Order order) {
  switch (order) {
    case Order::kScore:
      return "by score";
    case Order::kConsistentFirst:
      return "consistent ones first";
    case Order::kConsistentOnly:
      return "consistent ones only";
    case Order::kEachIslandFirst:
      return "the best of each island first";
  }
  return "";
}

namespace {

std::vector<std::size_t> inOrder(const PlaceQuery& query, Order order) {
  std::vector<std::size_t> first, later;
  std::vector<float> islands;  // known by their scores
  for (const PlaceCandidate& c : query.candidates) {
    const auto index = static_cast<std::size_t>(c.index);
    bool early = order == Order::kScore || c.consistent > 0;
    if (order == Order::kEachIslandFirst) {
      early = std::find(islands.begin(), islands.end(), c.island_score) == islands.end();
      islands.push_back(c.island_score);
    }
    (early ? first : later).push_back(index);
  }
  if (order != Order::kConsistentOnly) first.insert(first.end(), later.begin(), later.end());
  return first;
}

}  // namespace

void reportRetrieval(const ImageSet& set, const std::vector<PlaceQuery>& found,
                     const PlaceDatabaseSettings& settings, const Verdicts& reference,
                     const Verdicts& verified, Order order, const char* name) {
  const auto old_enough = [&](std::size_t i, std::size_t j) {
    return set.shots[j].seconds - set.shots[i].seconds >= settings.exclude;
  };
  std::size_t pairs = 0, revisiting = 0;
  std::vector<bool> revisits(found.size(), false);
  for (std::size_t j = 0; j < found.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      if (!old_enough(i, j) || reference[i][j] != Verdict::kRight) continue;
      revisits[j] = true;
      if (set.kind[i][j] == PairKind::kRevisit) ++pairs;
    }
    if (revisits[j]) ++revisiting;
  }
  std::printf("    retrieval, %s, %s (%zu pairs and %zu images to find):\n", name, describe(order), pairs,
              revisiting);
  for (const std::size_t most : {1U, 2U, 4U, 10U, 20U, 32U}) {
    if (most > settings.candidates) break;
    Yield y;
    std::size_t both = 0;
    for (std::size_t j = 0; j < found.size(); ++j) {
      bool closed = false;
      const std::vector<std::size_t> candidates = inOrder(found[j], order);
      for (std::size_t k = 0; k < std::min(most, candidates.size()); ++k) {
        const std::size_t i = candidates[k];
        const Verdict verdict = verified[i][j];
        const bool revisit = set.kind[i][j] == PairKind::kRevisit;
        if (revisit && verdict == Verdict::kRight) ++y.pairs;
        if (revisit && reference[i][j] == Verdict::kRight) ++both;
        if (closed) continue;
        ++y.verified;
        closed = verdict != Verdict::kRefused;
        y.false_ones += verdict == Verdict::kFalse ? 1U : 0U;
      }
      if (revisits[j]) ++y.images;
      if (revisits[j] && closed) ++y.closed;
    }
    std::printf(
        "      %2zu candidates: pairs proposed %zu (%.3f), verified %zu (%.3f); until one is accepted: "
        "images "
        "%zu (%.3f), false %zu, %.2f verifications an image\n",
        most, both, share(both, pairs), y.pairs, share(y.pairs, pairs), y.closed, share(y.closed, y.images),
        y.false_ones, share(y.verified, found.size()));
  }
}

}  // namespace swiftlet::loop_sets
