#pragma once
// An image as the words that its features are, and how alike two images are by them.

#include <cstdint>

#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

using WordId = std::uint32_t;

struct WordValue {
  WordId word = 0;
  float value = 0;  ///< the word's share in the image, by count and weight; > 0
};

/// Rising words, each once; values sum to 1 (empty: no feature, or none of weight).
using BagOfWords = FixedVector<WordValue, kMaxPlaceFeatures>;

/// 1 - |a - b|_1 / 2, in [0, 1]: for shares this is the sum of the lesser values of common words (Nister,
/// Stewenius, "Scalable Recognition with a Vocabulary Tree", CVPR 2006, eq. 5). About 1 us.
float similarity(const BagOfWords& a, const BagOfWords& b);

}  // namespace swiftlet
