#include "mapping/place/vocabulary_training.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/core/random.hpp"
#include "mapping/place/hamming.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kBits = 256;

class Tree {
 public:
  Tree(std::span<const Descriptor> all, const VocabularyTraining& settings)
      : all_(all), settings_(settings), random_(settings.seed), members_(all.size()), cluster_(all.size()) {
    std::iota(members_.begin(), members_.end(), 0U);
  }

  std::vector<VocabularyNode> grow() {
    split(0, members_, 0);
    return std::move(nodes_);
  }

 private:
  using Members = std::span<std::uint32_t>;

  // Draws each next centre with a probability proportional to the squared distance to the nearest one so far.
  std::vector<Descriptor> firstCentres(Members members) {
    std::vector<Descriptor> centres = {
        all_[members[random_.below(static_cast<std::uint32_t>(members.size()))]]};
    std::vector<double> nearest(members.size(), 1e9);
    while (centres.size() < static_cast<std::size_t>(settings_.branching)) {
      double sum = 0;
      for (std::size_t i = 0; i < members.size(); ++i) {
        const double d = hammingDistance(all_[members[i]], centres.back());
        nearest[i] = std::min(nearest[i], d * d);
        sum += nearest[i];
      }
      if (sum <= 0) break;
      double left = random_.uniform() * sum;
      std::size_t pick = members.size();
      for (std::size_t i = 0; i < members.size() && (left >= 0 || pick == members.size()); ++i) {
        if (nearest[i] <= 0) continue;
        pick = i;
        left -= nearest[i];
      }
      centres.push_back(all_[members[pick]]);
    }
    return centres;
  }

  bool assign(Members members, const std::vector<Descriptor>& centres) {
    bool changed = false;
    for (const std::uint32_t m : members) {
      std::uint32_t best = 0;
      int least = static_cast<int>(kBits) + 1;
      for (std::uint32_t c = 0; c < centres.size(); ++c) {
        const int d = hammingDistance(all_[m], centres[c]);
        if (d >= least) continue;
        least = d;
        best = c;
      }
      changed = changed || cluster_[m] != best;
      cluster_[m] = best;
    }
    return changed;
  }

  // The majority of each bit; a centre without members stays.
  void move(Members members, std::vector<Descriptor>& centres) const {
    std::vector<std::array<std::uint32_t, kBits>> ones(centres.size());
    std::vector<std::uint32_t> size(centres.size(), 0);
    for (auto& counts : ones) counts.fill(0);
    for (const std::uint32_t m : members) {
      std::uint32_t* counts = ones[cluster_[m]].data();
      ++size[cluster_[m]];
      for (const std::uint64_t word : all_[m].words) {
        for (unsigned bit = 0; bit < 64; ++bit) *counts++ += static_cast<std::uint32_t>(word >> bit & 1U);
      }
    }
    for (std::size_t c = 0; c < centres.size(); ++c) {
      if (size[c] == 0) continue;
      for (std::size_t bit = 0; bit < kBits; ++bit) {
        const std::uint64_t mask = std::uint64_t{1} << (bit % 64);
        std::uint64_t& word = centres[c].words[bit / 64];
        word = 2 * ones[c][bit] > size[c] ? word | mask : word & ~mask;
      }
    }
  }

  void split(std::uint32_t parent, Members members, int level) {
    if (level >= settings_.depth) return;
    std::vector<Descriptor> centres = firstCentres(members);
    if (centres.size() < 2 && level > 0) return;
    for (const std::uint32_t m : members) cluster_[m] = static_cast<std::uint32_t>(centres.size());
    for (int i = 0; i < settings_.iterations && assign(members, centres); ++i) move(members, centres);
    (void)assign(members, centres);
    std::stable_sort(members.begin(), members.end(),
                     [this](std::uint32_t a, std::uint32_t b) { return cluster_[a] < cluster_[b]; });
    std::vector<std::pair<std::uint32_t, Members>> children;
    for (std::size_t begin = 0; begin < members.size();) {
      const std::uint32_t c = cluster_[members[begin]];
      std::size_t end = begin;
      while (end < members.size() && cluster_[members[end]] == c) ++end;
      nodes_.push_back({parent, centres[c], 0.0F});
      children.push_back({static_cast<std::uint32_t>(nodes_.size()), members.subspan(begin, end - begin)});
      begin = end;
    }
    if (children.size() < 2 && level > 0) {
      nodes_.pop_back();
      return;
    }
    for (const auto& [node, own] : children) split(node, own, level + 1);
  }

  std::span<const Descriptor> all_;
  const VocabularyTraining& settings_;
  Random random_;
  std::vector<std::uint32_t> members_;
  std::vector<std::uint32_t> cluster_;
  std::vector<VocabularyNode> nodes_;
};

}  // namespace

Status trainVocabulary(std::span<const Descriptor> descriptors, std::span<const std::size_t> image_ends,
                       const VocabularyTraining& settings, Vocabulary& vocabulary) {
  if (settings.branching < 2 || settings.branching > static_cast<int>(Vocabulary::kMaxChildren) ||
      settings.depth < 1 || settings.depth > Vocabulary::kMaxDepth || settings.iterations < 1) {
    return {StatusCode::kInvalidInput, "a vocabulary's branching or depth is out of bounds"};
  }
  if (descriptors.empty()) return {StatusCode::kDegenerate, "no descriptors to train a vocabulary from"};
  if (image_ends.empty() || image_ends.back() != descriptors.size() ||
      !std::is_sorted(image_ends.begin(), image_ends.end())) {
    return {StatusCode::kInvalidInput, "the images' ends do not fit the descriptors"};
  }
  std::vector<VocabularyNode> nodes = Tree(descriptors, settings).grow();
  // Weights need the words of the descriptors: assemble the tree with weights of 1 first.
  for (VocabularyNode& node : nodes) node.weight = 1;
  if (const Status status = vocabulary.assemble(nodes); !status.ok()) return status;
  std::vector<std::size_t> images_with(vocabulary.words(), 0);
  std::vector<std::size_t> newest(vocabulary.words(), 0);
  std::size_t at = 0;
  for (std::size_t image = 0; image < image_ends.size(); ++image) {
    for (; at < image_ends[image]; ++at) {
      const WordId word = vocabulary.word(descriptors[at]);
      if (newest[word] == image + 1) continue;
      newest[word] = image + 1;
      ++images_with[word];
    }
  }
  std::vector<float> weights(vocabulary.words(), 0);
  for (std::size_t w = 0; w < weights.size(); ++w) {
    const auto seen = static_cast<double>(std::max<std::size_t>(images_with[w], 1));
    weights[w] = static_cast<float>(std::log(static_cast<double>(image_ends.size()) / seen));
  }
  return vocabulary.weigh(weights);
}

}  // namespace swiftlet
