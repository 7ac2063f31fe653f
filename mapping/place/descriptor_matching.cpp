#include "mapping/place/descriptor_matching.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

namespace swiftlet {
namespace {

// Larger than any distance between descriptors.
constexpr std::uint16_t kFar = 512;

}  // namespace

void DescriptorMatcher::loadNew(const PlaceFeatures& new_features, Nodes nodes) {
  count_ = new_features.size();
  const auto end = order_.begin() + static_cast<std::ptrdiff_t>(count_);
  std::iota(order_.begin(), end, std::uint16_t{0});
  if (!nodes.empty()) {
    // By index within a node, so that equal distances go to the smaller index.
    std::sort(order_.begin(), end, [&](std::uint16_t a, std::uint16_t b) {
      return nodes[a] != nodes[b] ? nodes[a] < nodes[b] : a < b;
    });
  }
  for (std::size_t place = 0; place < count_; ++place) {
    const PlaceFeature& feature = new_features[order_[place]];
    for (std::size_t w = 0; w < words_.size(); ++w) words_[w][place] = feature.descriptor.words[w];
    node_[place] = nodes.empty() ? 0 : nodes[order_[place]];
  }
  nearest_distance_.fill(kFar);
}

DescriptorMatcher::Range DescriptorMatcher::rangeOf(std::uint32_t node, bool all) const {
  if (all) return {0, count_};
  const auto end = node_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto [low, high] = std::equal_range(node_.begin(), end, node);
  return {static_cast<std::size_t>(low - node_.begin()), static_cast<std::size_t>(high - node_.begin())};
}

void DescriptorMatcher::fillRow(const Descriptor& descriptor, Range range) {
  const auto [w0, w1, w2, w3] = descriptor.words;
  for (std::size_t j = range.first; j < range.last; ++j) {
    row_[j] = static_cast<std::uint16_t>(std::popcount(w0 ^ words_[0][j]) + std::popcount(w1 ^ words_[1][j]) +
                                         std::popcount(w2 ^ words_[2][j]) + std::popcount(w3 ^ words_[3][j]));
  }
}

DescriptorMatcher::Nearest DescriptorMatcher::nearestInRow(Range range) const {
  std::uint16_t least = kFar;
  for (std::size_t j = range.first; j < range.last; ++j) least = std::min(least, row_[j]);
  const auto first = row_.begin() + static_cast<std::ptrdiff_t>(range.first);
  const auto last = row_.begin() + static_cast<std::ptrdiff_t>(range.last);
  return {static_cast<std::uint16_t>(std::find(first, last, least) - row_.begin()), least};
}

bool DescriptorMatcher::unique(const PlaceFeatures& new_features, Range range, Nearest nearest,
                               const DescriptorMatchSettings& settings) const {
  if (settings.ratio >= 1.0F) return true;
  const Eigen::Vector2f& spot = new_features[order_[nearest.place]].pixel;
  for (std::size_t j = range.first; j < range.last; ++j) {
    if (static_cast<float>(nearest.distance) < settings.ratio * static_cast<float>(row_[j])) continue;
    const Eigen::Vector2f& rival = new_features[order_[j]].pixel;
    if (!((rival - spot).squaredNorm() < settings.same_spot * settings.same_spot)) return false;
  }
  return true;
}

Status DescriptorMatcher::match(const PlaceFeatures& old_features, const PlaceFeatures& new_features,
                                const DescriptorMatchSettings& settings, DescriptorMatches& matches,
                                Nodes old_nodes, Nodes new_nodes) {
  matches.clear();
  const bool all = old_nodes.empty() && new_nodes.empty();
  if (!all && (old_nodes.size() != old_features.size() || new_nodes.size() != new_features.size())) {
    return {StatusCode::kInvalidInput, "descriptor matching: one vocabulary node per feature is needed"};
  }
  loadNew(new_features, new_nodes);
  std::array<std::uint16_t, kMaxPlaceFeatures> place{};
  for (std::size_t i = 0; i < old_features.size(); ++i) {
    const Range range = rangeOf(all ? 0 : old_nodes[i], all);
    if (range.first == range.last) continue;
    fillRow(old_features[i].descriptor, range);
    for (std::size_t j = range.first; j < range.last; ++j) {
      if (row_[j] >= nearest_distance_[j]) continue;
      nearest_distance_[j] = row_[j];
      nearest_old_[j] = static_cast<std::uint16_t>(i);
    }
    const Nearest nearest = nearestInRow(range);
    if (nearest.distance > settings.max_distance) continue;
    if (!unique(new_features, range, nearest, settings)) continue;
    place[matches.size()] = nearest.place;
    // Cannot be full: one per old feature.
    (void)matches.tryPushBack({static_cast<std::uint16_t>(i), order_[nearest.place], nearest.distance});
  }
  if (!settings.mutual) return okStatus();
  std::size_t kept = 0;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (nearest_old_[place[m]] == matches[m].old_feature) matches[kept++] = matches[m];
  }
  matches.resize(kept);
  return okStatus();
}

}  // namespace swiftlet
