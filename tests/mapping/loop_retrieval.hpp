#pragma once
// Which pairs of an image set the database of places proposes, and how many loops come of them.

#include <vector>

#include "mapping/place/place_database.hpp"
#include "mapping/place/place_keyframe.hpp"
#include "mapping/place/vocabulary.hpp"
#include "tests/mapping/loop_sets.hpp"

namespace swiftlet::loop_sets {

/// What verification said of a pair, and the truth of that.
enum class Verdict { kRefused, kRight, kFalse };
/// Of the pair (i, j), i < j.
using Verdicts = std::vector<std::vector<Verdict>>;

/// All images in the order of time: query, then add.
std::vector<PlaceQuery> retrieve(const ImageSet& set, const std::vector<PlaceKeyframe>& keyframes,
                                 const Vocabulary& vocabulary, const PlaceDatabaseSettings& settings);

/// In which candidates are verified.
enum class Order { kScore, kConsistentFirst, kConsistentOnly, kEachIslandFirst };

/// Prints what share of the pairs and of the images that revisit (by `reference`, a verification of all
/// pairs) comes out when only candidates are verified, as `verified` says.
void reportRetrieval(const ImageSet& set, const std::vector<PlaceQuery>& found,
                     const PlaceDatabaseSettings& settings, const Verdicts& reference,
                     const Verdicts& verified, Order order, const char* name);

}  // namespace swiftlet::loop_sets
