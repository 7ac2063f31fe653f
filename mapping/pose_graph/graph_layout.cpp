#include "mapping/pose_graph/graph_layout.hpp"

#include <algorithm>
#include <numeric>

namespace swiftlet {

std::vector<std::uint32_t> graphPieces(std::size_t poses, std::span<const BlockPair> ends,
                                       std::uint32_t& count) {
  std::vector<std::uint32_t> root(poses);
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&root](std::uint32_t k) {
    while (root[k] != k) {
      root[k] = root[root[k]];
      k = root[k];
    }
    return k;
  };
  for (const auto& [from, to] : ends) {
    const std::uint32_t a = find(from);
    const std::uint32_t b = find(to);
    root[std::max(a, b)] = std::min(a, b);  // the root is the piece's first pose
  }
  std::vector<std::uint32_t> piece(poses);
  count = 0;
  for (std::uint32_t k = 0; k < poses; ++k) {
    const std::uint32_t first = find(k);
    piece[k] = first == k ? count++ : piece[first];
  }
  return piece;
}

bool GraphLayout::append(const BlockPair& ends) {
  const BlockPair pair = std::minmax(unknown[ends.first], unknown[ends.second]);
  const auto at = std::lower_bound(pairs.begin(), pairs.end(), pair);
  if (at == pairs.end() || *at != pair) return false;
  edge_pair.push_back(static_cast<std::uint32_t>(at - pairs.begin()));
  edge_reversed.push_back(unknown[ends.first] > unknown[ends.second]);
  return true;
}

void GraphLayout::arrange(std::size_t poses, std::span<const BlockPair> ends,
                          const std::vector<bool>& given_held, const std::vector<bool>& knows_vertical) {
  const std::vector<std::uint32_t> piece = graphPieces(poses, ends, pieces);
  std::vector<bool> has_held(pieces, false);
  std::vector<bool> upright(pieces, false);
  for (std::size_t k = 0; k < poses; ++k) {
    if (given_held[k]) has_held[piece[k]] = true;
    if (knows_vertical[k]) upright[piece[k]] = true;
  }
  unknown.assign(poses, kHeld);
  held.clear();
  anchors.clear();
  unknowns = 0;
  for (std::uint32_t k = 0; k < poses; ++k) {
    const bool first = !has_held[piece[k]];
    has_held[piece[k]] = true;
    if (given_held[k] || (first && !upright[piece[k]])) {
      held.push_back(k);
    } else {
      unknown[k] = unknowns++;
      if (first) anchors.push_back(k);
    }
  }
  // Edges sorted by their two unknowns: each run is one pair.
  std::vector<std::uint32_t> joining;
  edge_pair.assign(ends.size(), kNoPair);
  edge_reversed.assign(ends.size(), false);
  const auto key = [&](std::uint32_t e) {
    const auto [low, high] = std::minmax(unknown[ends[e].first], unknown[ends[e].second]);
    return std::uint64_t{low} << 32U | high;
  };
  for (std::uint32_t e = 0; e < ends.size(); ++e) {
    if (unknown[ends[e].first] == kHeld || unknown[ends[e].second] == kHeld) continue;
    joining.push_back(e);
    edge_reversed[e] = unknown[ends[e].first] > unknown[ends[e].second];
  }
  std::sort(joining.begin(), joining.end(),
            [&](std::uint32_t a, std::uint32_t b) { return std::pair(key(a), a) < std::pair(key(b), b); });
  pairs.clear();
  for (std::size_t k = 0; k < joining.size(); ++k) {
    const std::uint64_t at = key(joining[k]);
    if (k == 0 || at != key(joining[k - 1])) {
      pairs.emplace_back(static_cast<std::uint32_t>(at >> 32U), static_cast<std::uint32_t>(at));
    }
    edge_pair[joining[k]] = static_cast<std::uint32_t>(pairs.size() - 1);
  }
  structure.analyze(unknowns, pairs);
}

}  // namespace swiftlet
