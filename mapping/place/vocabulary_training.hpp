#pragma once
// Trains a vocabulary from descriptors. The tree comes from repeated k-majority clustering: k-means under
// Hamming distance, whose centre is the majority of each bit (Grana, Borghesani, Manfredi, Cucchiara, "A fast
// approach for integrating ORB descriptors in the bag of words model", SPIE 2013), initialized as k-means++
// (Arthur, Vassilvitskii, SODA 2007). Words weigh ln(images / images with the word).
//
// Offline: allocates, takes seconds for a million descriptors. Same descriptors and seed, same tree.

#include <cstdint>
#include <span>

#include "estimator/core/status.hpp"
#include "mapping/place/vocabulary.hpp"

namespace swiftlet {

struct VocabularyTraining {
  int branching = 10;
  int depth = 4;
  int iterations = 12;  ///< largest number per clustering
  std::uint64_t seed = 1;
};

/// `image_ends`: one past the last descriptor of each image, ascending. kInvalidInput for settings outside
/// Vocabulary's limits or ends that do not fit, kDegenerate without descriptors.
[[nodiscard]] Status trainVocabulary(std::span<const Descriptor> descriptors,
                                     std::span<const std::size_t> image_ends,
                                     const VocabularyTraining& settings, Vocabulary& vocabulary);

}  // namespace swiftlet
