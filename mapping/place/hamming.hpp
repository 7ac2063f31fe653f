#pragma once
// Hamming distance of two descriptors.

#include <bit>

#include "mapping/place/place_keyframe.hpp"

namespace swiftlet {

/// Number of bits, 0 to 256, in which the two differ. About 2 ns.
inline int hammingDistance(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.words.size(); ++i) distance += std::popcount(a.words[i] ^ b.words[i]);
  return distance;
}

}  // namespace swiftlet
