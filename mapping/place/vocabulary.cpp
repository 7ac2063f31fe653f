#include "mapping/place/vocabulary.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "mapping/place/hamming.hpp"
#include "mapping/place/shipped_vocabulary.hpp"

namespace swiftlet {
namespace {

constexpr std::array<char, 8> kMagic = {'S', 'W', 'P', 'L', 'A', 'C', 'E', 'S'};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeader = 8 + 4 + 4 + 1;
constexpr std::size_t kNodeBytes = 1 + 32;
constexpr std::size_t kChecksumBytes = 8;

std::uint64_t fnv1a(std::span<const std::uint8_t> bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const std::uint8_t b : bytes) hash = (hash ^ b) * 1099511628211ULL;
  return hash;
}

template <typename T>
T littleEndian(const std::uint8_t* from) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | (static_cast<T>(from[i]) << (8 * i)));
  return value;
}

template <typename T>
void append(std::vector<std::uint8_t>& to, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

constexpr Status refused(const char* what) { return {StatusCode::kInvalidInput, what}; }

}  // namespace

const Vocabulary& Vocabulary::shipped() {
  static const Vocabulary kShipped = [] {
    Vocabulary vocabulary;
    (void)vocabulary.load(shippedVocabularyBytes());  // a test checks that this succeeds
    return vocabulary;
  }();
  return kShipped;
}

void Vocabulary::clear() {
  nodes_.clear();
  leaf_of_.clear();
  words_ = 0;
  depth_ = 0;
}

// Numbers the leaves as words and counts the levels. Nodes must be in breadth-first order.
Status Vocabulary::number() {
  std::size_t level_end = 1;
  depth_ = 0;
  for (std::size_t n = 0, next_end = 1; n < nodes_.size(); ++n) {
    if (n == level_end) {
      ++depth_;
      level_end = next_end;
    }
    Node& node = nodes_[n];
    if (node.children > 0) {
      next_end = node.first_child + node.children;
    } else if (n > 0) {
      if (!std::isfinite(node.weight) || node.weight < 0)
        return refused("a word's weight is negative or not finite");
      node.word = static_cast<WordId>(words_++);
      leaf_of_.push_back(static_cast<std::uint32_t>(n));
    }
  }
  if (words_ == 0) return refused("the vocabulary has no words");
  if (depth_ > kMaxDepth) return refused("the vocabulary has too many levels");
  return okStatus();
}

Status Vocabulary::load(std::span<const std::uint8_t> bytes) {
  clear();
  if (bytes.size() < kHeader + kChecksumBytes ||
      std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) != 0) {
    return refused("not a vocabulary for place recognition");
  }
  if (littleEndian<std::uint32_t>(bytes.data() + 8) != kVersion) {
    return refused("the vocabulary has another version: train or convert it again");
  }
  const std::size_t count = littleEndian<std::uint32_t>(bytes.data() + 12);
  const std::span<const std::uint8_t> content = bytes.first(bytes.size() - kChecksumBytes);
  if (littleEndian<std::uint64_t>(bytes.data() + content.size()) != fnv1a(content)) {
    return refused("the vocabulary is damaged: its checksum does not match");
  }
  if (count == 0 || (content.size() - kHeader) / kNodeBytes < count)
    return refused("the vocabulary is truncated");
  nodes_.resize(count + 1);
  nodes_[0].children = bytes[16];
  const std::uint8_t* at = bytes.data() + kHeader;
  for (std::size_t n = 1; n <= count; ++n) {
    nodes_[n].children = *at++;
    for (std::uint64_t& word : nodes_[n].descriptor.words) {
      word = littleEndian<std::uint64_t>(at);
      at += 8;
    }
  }
  std::size_t next = 1;
  std::size_t leaves = 0;
  for (std::size_t n = 0; n <= count; ++n) {
    if (n >= next) {
      clear();
      return refused("the vocabulary's nodes are not a tree");
    }
    nodes_[n].first_child = static_cast<std::uint32_t>(next);
    next += nodes_[n].children;
    if (nodes_[n].children == 0) ++leaves;
  }
  if (next != count + 1 || static_cast<std::size_t>(bytes.data() + content.size() - at) != leaves * 4) {
    clear();
    return refused("the vocabulary's nodes are not a tree");
  }
  for (Node& node : nodes_) {
    if (node.children > 0) continue;
    node.weight = std::bit_cast<float>(littleEndian<std::uint32_t>(at));
    at += 4;
  }
  const Status status = number();
  if (!status.ok()) clear();
  return status;
}

std::vector<std::uint8_t> Vocabulary::compact() const {
  std::vector<std::uint8_t> out(kMagic.begin(), kMagic.end());
  append(out, kVersion);
  append(out, static_cast<std::uint32_t>(nodes()));
  if (nodes_.empty()) out.push_back(0);
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    out.push_back(static_cast<std::uint8_t>(nodes_[n].children));
    if (n == 0) continue;
    for (const std::uint64_t word : nodes_[n].descriptor.words) append(out, word);
  }
  for (const std::uint32_t leaf : leaf_of_) append(out, std::bit_cast<std::uint32_t>(nodes_[leaf].weight));
  append(out, fnv1a(out));
  return out;
}

Status Vocabulary::assemble(std::span<const VocabularyNode> list) {
  clear();
  if (list.empty()) return refused("the vocabulary has no nodes");
  // Children of each node: counted, then listed one after the other in the order of the list.
  std::vector<std::uint32_t> first(list.size() + 2, 0);
  for (const VocabularyNode& node : list) {
    if (node.parent > list.size()) return refused("a node's parent does not exist");
    ++first[node.parent + 1];
  }
  if (*std::max_element(first.begin(), first.end()) > kMaxChildren)
    return refused("a node has too many children");
  for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  std::vector<std::uint32_t> child(list.size());
  std::vector<std::uint32_t> filled(first.begin(), first.end() - 1);
  for (std::size_t i = 0; i < list.size(); ++i) {
    child[filled[list[i].parent]++] = static_cast<std::uint32_t>(i + 1);
  }
  std::vector<std::uint32_t> order = {0};  // breadth first; nodes of a cycle are never reached
  nodes_.resize(list.size() + 1);
  for (std::size_t n = 0; n < order.size(); ++n) {
    const std::uint32_t id = order[n];
    Node& node = nodes_[n];
    node.children = first[id + 1] - first[id];
    node.first_child = static_cast<std::uint32_t>(order.size());
    if (id > 0) node.descriptor = list[id - 1].descriptor;
    if (id > 0 && node.children == 0) node.weight = list[id - 1].weight;
    for (std::uint32_t c = first[id]; c < first[id + 1]; ++c) order.push_back(child[c]);
  }
  Status status = okStatus();
  if (order.size() != nodes_.size()) status = refused("a node is its own ancestor");
  if (status.ok()) status = number();
  if (!status.ok()) clear();
  return status;
}

Status Vocabulary::weigh(std::span<const float> weights) {
  if (weights.size() != words_) return refused("the numbers of weights and words differ");
  for (const float w : weights) {
    if (!std::isfinite(w) || w < 0) return refused("a word's weight is negative or not finite");
  }
  for (std::size_t w = 0; w < words_; ++w) nodes_[leaf_of_[w]].weight = weights[w];
  return okStatus();
}

WordId Vocabulary::word(const Descriptor& descriptor) const {
  const Node* node = nodes_.data();
  while (node->children > 0) {
    const Node* best = nodes_.data() + node->first_child;
    int least = hammingDistance(best->descriptor, descriptor);
    for (const Node *other = best + 1, *end = best + node->children; other != end; ++other) {
      const int d = hammingDistance(other->descriptor, descriptor);
      if (d >= least) continue;
      least = d;
      best = other;
    }
    node = best;
  }
  return node->word;
}

Status Vocabulary::describe(const PlaceKeyframe& keyframe, BagOfWords& bag) const {
  bag.clear();
  if (words_ == 0) return {StatusCode::kNotReady, "place recognition has no vocabulary"};
  FixedVector<WordId, kMaxPlaceFeatures> found;
  for (const PlaceFeature& f : keyframe.features) {
    const WordId w = word(f.descriptor);
    if (weight(w) > 0) (void)found.tryPushBack(w);  // as many as features
  }
  std::sort(found.begin(), found.end());
  float sum = 0;
  for (const WordId w : found) {
    if (bag.empty() || bag.back().word != w) (void)bag.tryPushBack({w, 0.0F});
    bag.back().value += weight(w);
    sum += weight(w);
  }
  for (WordValue& entry : bag) entry.value /= sum;
  return okStatus();
}

}  // namespace swiftlet
