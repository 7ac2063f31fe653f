#pragma once
// The words of place recognition: a tree of descriptors. The word of a feature is the leaf reached from the
// root through the nearest children by Hamming distance (Nister, Stewenius, CVPR 2006; for binary descriptors
// Galvez-Lopez, Tardos, "Bags of Binary Words for Fast Place Recognition in Image Sequences", T-RO 2012). The
// weight of a word is its inverse document frequency.
//
// Memory: 48 bytes a node, allocated by load() and assemble(); nothing afterwards. Finding a word
// costs depth x branching Hamming distances, some 100 ns for 10 x 4.
//
// File ("compact"), little-endian: "SWPLACES", u32 version (1), u32 nodes without the root, u8 children of
// the root; for each node, breadth first, u8 children and 32 bytes of descriptor; for each leaf in that order
// a float32 weight; u64 FNV-1a of all bytes before. Words are the leaves in that order.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/status.hpp"
#include "mapping/place/bag_of_words.hpp"

namespace swiftlet {

/// A node in a list: nodes are numbered from 1 in the order of the list, 0 is the root.
struct VocabularyNode {
  std::uint32_t parent = 0;
  Descriptor descriptor;
  float weight = 0;  ///< of a leaf
};

class Vocabulary {
 public:
  static constexpr int kMaxDepth = 16;
  static constexpr std::size_t kMaxChildren = 255;

  /// The vocabulary embedded in the program. Created at the first call.
  static const Vocabulary& shipped();

  /// From the compact form. On kInvalidInput the vocabulary is empty.
  [[nodiscard]] Status load(std::span<const std::uint8_t> bytes);
  [[nodiscard]] std::vector<std::uint8_t> compact() const;
  /// From a list of nodes in any order. kInvalidInput, and an empty vocabulary, if they are not a valid tree:
  /// a missing parent, a cycle, more children or levels than the limits, a weight that is negative or not
  /// finite.
  [[nodiscard]] Status assemble(std::span<const VocabularyNode> nodes);

  /// Sets the weights, one for each word. kInvalidInput, without effect, if their number differs from that of
  /// the words, or one is negative or not finite.
  [[nodiscard]] Status weigh(std::span<const float> weights);

  [[nodiscard]] std::size_t words() const { return words_; }
  [[nodiscard]] std::size_t nodes() const { return nodes_.empty() ? 0 : nodes_.size() - 1; }
  [[nodiscard]] int depth() const { return depth_; }
  [[nodiscard]] WordId word(const Descriptor& descriptor) const;
  [[nodiscard]] float weight(WordId word) const { return nodes_[leaf_of_[word]].weight; }
  /// kNotReady for an empty vocabulary.
  [[nodiscard]] Status describe(const PlaceKeyframe& keyframe, BagOfWords& bag) const;

 private:
  struct Node {
    Descriptor descriptor;
    std::uint32_t first_child = 0;
    std::uint32_t children = 0;
    WordId word = 0;   ///< of a leaf
    float weight = 0;  ///< of a leaf
  };

  void clear();
  [[nodiscard]] Status number();

  std::vector<Node> nodes_;  ///< breadth first, the root at 0
  std::vector<std::uint32_t> leaf_of_;
  std::size_t words_ = 0;
  int depth_ = 0;
};

}  // namespace swiftlet
