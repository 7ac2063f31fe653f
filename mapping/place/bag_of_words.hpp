#pragma once
// An image as a bag of words, and the similarity of two images.

#include <cstdint>

#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

using WordId = std::uint32_t;

struct WordValue {
  WordId word = 0;
  float value = 0;  ///< share of the word in the image, by count and weight; > 0
};

/// Ascending words, each once; values sum to 1. Empty if no feature has a word of positive weight.
using BagOfWords = FixedVector<WordValue, kMaxPlaceFeatures>;

/// 1 - |a - b|_1 / 2, in [0, 1], which for shares is the sum of the smaller values of common words (Nister,
/// Stewenius, "Scalable Recognition with a Vocabulary Tree", CVPR 2006, eq. 5). About 1 us.
float similarity(const BagOfWords& a, const BagOfWords& b);

}  // namespace swiftlet
