#include "mapping/pose_graph/maximum_clique.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

std::uint32_t firstBit(ConstBitSet set) {
  for (std::size_t w = 0; w < set.size(); ++w) {
    if (set[w] != 0) {
      return static_cast<std::uint32_t>(w * kBitsPerWord) +
             static_cast<std::uint32_t>(std::countr_zero(set[w]));
    }
  }
  return static_cast<std::uint32_t>(set.size()) * kBitsPerWord;
}

bool isEmpty(ConstBitSet set) {
  return std::all_of(set.begin(), set.end(), [](std::uint64_t word) { return word == 0; });
}

void remove(BitSet set, ConstBitSet what) {
  for (std::size_t w = 0; w < set.size(); ++w) {
    set[w] &= ~what[w];
  }
}

}  // namespace

MaximumClique::MaximumClique(std::uint32_t capacity, std::uint32_t max_depth)
    : max_words_(wordsFor(capacity)),
      max_depth_(std::max(max_depth, 1U)),
      core_(max_words_),
      free_(max_words_),
      numbers_(capacity),
      conflicts_(std::size_t{capacity} * max_words_),
      counts_(capacity),
      best_(max_words_),
      scratch_(max_words_),
      colour_(max_words_),
      levels_bits_(std::size_t{max_depth_} * 2 * max_words_),
      levels_(max_depth_) {}

CliqueResult MaximumClique::search(const ConsistencyGraph& graph, ConstBitSet candidates,
                                   std::uint32_t at_least, std::uint32_t max_nodes, BitSet best) {
  std::copy(candidates.begin(), candidates.end(), core_.begin());
  if (!keepCore(graph, at_least + 1)) {
    return {};
  }
  numberConflicts(graph);
  const std::uint32_t free = countBits(free_);
  // How many numbered candidates are needed.
  const std::uint32_t target = at_least + 1 > free ? at_least + 1 - free : 0;
  CliqueResult result;
  if (numbers_.empty()) {
    result.size = target == 0 ? free : 0;
  } else {
    peel();
    result = branch(std::max(target, countBits(ConstBitSet(best_.data(), words_)) + 1), max_nodes);
    const std::uint32_t found = countBits(ConstBitSet(best_.data(), words_));
    result.size = found >= target ? free + found : 0;
  }
  if (result.size > 0) {
    std::copy(free_.begin(), free_.end(), best.begin());
    if (!numbers_.empty()) {
      forEachBit(ConstBitSet(best_.data(), words_), [&](std::uint32_t k) { setBit(best, numbers_[k]); });
    }
  }
  return result;
}

/// False when fewer than `target` candidates are left.
bool MaximumClique::keepCore(const ConsistencyGraph& graph, std::uint32_t target) {
  std::uint32_t left = countBits(core_);
  for (bool changed = true; changed && left >= target;) {
    changed = false;
    forEachBit(core_, [&](std::uint32_t k) {
      if (countBoth(graph.row(k), core_) + 1 < target) {
        clearBit(core_, k);
        --left;
        changed = true;
      }
    });
  }
  return left >= target && left > 0;
}

void MaximumClique::numberConflicts(const ConsistencyGraph& graph) {
  std::fill(free_.begin(), free_.end(), 0);
  numbers_.clear();
  const std::uint32_t left = countBits(core_);
  forEachBit(core_, [&](std::uint32_t k) {
    if (countBoth(graph.row(k), core_) + 1 == left) {
      setBit(free_, k);
    } else {
      numbers_.push_back(k);
    }
  });
  const auto count = static_cast<std::uint32_t>(numbers_.size());
  words_ = wordsFor(count);
  std::fill(conflicts_.begin(), conflicts_.begin() + static_cast<std::ptrdiff_t>(std::size_t{count} * words_),
            0);
  for (std::uint32_t a = 0; a < count; ++a) {
    const BitSet row{conflicts_.data() + std::size_t{a} * words_, words_};
    const ConstBitSet agree = graph.row(numbers_[a]);
    for (std::uint32_t b = 0; b < count; ++b) {
      if (a != b && !testBit(agree, numbers_[b])) {
        setBit(row, b);
      }
    }
  }
}

void MaximumClique::peel() {
  const auto count = static_cast<std::uint32_t>(numbers_.size());
  const BitSet set{best_.data(), words_};
  std::fill(set.begin(), set.end(), 0);
  for (std::uint32_t k = 0; k < count; ++k) {
    setBit(set, k);
    counts_[k] = countBits(conflicts(k));
  }
  while (true) {
    std::uint32_t worst = 0;
    std::uint32_t most = 0;
    forEachBit(set, [&](std::uint32_t k) {
      if (counts_[k] >= most) {
        most = counts_[k];
        worst = k;
      }
    });
    if (most == 0) {
      break;
    }
    clearBit(set, worst);
    forEachBit(conflicts(worst), [&](std::uint32_t k) { --counts_[k]; });
  }
  bringBack(set);
}

void MaximumClique::bringBack(BitSet set) {
  for (std::uint32_t k = 0; k < numbers_.size(); ++k) {
    if (!testBit(set, k) && countBoth(conflicts(k), set) == 0) {
      setBit(set, k);
    }
  }
}

/// Takes and drops candidates where this is safe. False if `target` cannot be reached.
bool MaximumClique::reduce(BitSet open, BitSet taken, std::uint32_t& size, std::uint32_t target) {
  std::uint32_t left = countBits(open);
  for (bool changed = true; changed;) {
    changed = false;
    forEachBit(ConstBitSet(open), [&](std::uint32_t k) {
      if (!testBit(open, k)) {
        return;  // removed since the word was read
      }
      const std::uint32_t count = countBoth(conflicts(k), open);
      if (count <= 1) {
        setBit(taken, k);
        clearBit(open, k);
        remove(open, conflicts(k));
        ++size;
        left -= 1 + count;
        changed = true;
      } else if (size + left - count < target) {
        clearBit(open, k);
        --left;
        changed = true;
      }
    });
    if (size + left < target) {
      return false;
    }
  }
  return true;
}

/// Number of groups of mutually conflicting candidates, counted up to `enough`.
std::uint32_t MaximumClique::colours(ConstBitSet open, std::uint32_t enough) {
  const BitSet left{scratch_.data(), words_};
  const BitSet group{colour_.data(), words_};
  std::copy(open.begin(), open.end(), left.begin());
  std::uint32_t count = 0;
  while (count < enough && !isEmpty(left)) {
    std::copy(left.begin(), left.end(), group.begin());
    while (!isEmpty(group)) {
      const std::uint32_t k = firstBit(group);
      clearBit(left, k);
      for (std::size_t w = 0; w < words_; ++w) {
        group[w] &= conflicts(k)[w];
      }
    }
    ++count;
  }
  return count;
}

std::uint32_t MaximumClique::mostConflicts(ConstBitSet open) const {
  std::uint32_t worst = 0;
  std::uint32_t most = 0;
  forEachBit(open, [&](std::uint32_t k) {
    const std::uint32_t count = countBoth(conflicts(k), open);
    if (count >= most) {
      most = count;
      worst = k;
    }
  });
  return worst;
}

CliqueResult MaximumClique::branch(std::uint32_t target, std::uint32_t max_nodes) {
  CliqueResult result;
  const auto count = static_cast<std::uint32_t>(numbers_.size());
  std::fill(openAt(0).begin(), openAt(0).end(), 0);
  std::fill(takenAt(0).begin(), takenAt(0).end(), 0);
  for (std::uint32_t k = 0; k < count; ++k) {
    setBit(openAt(0), k);
  }
  levels_[0] = {};
  // The node at `depth` is to be visited; those above it wait for their second branch.
  for (std::uint32_t depth = 0;;) {
    if (result.nodes == max_nodes) {
      result.exact = false;
      return result;
    }
    ++result.nodes;
    Level& level = levels_[depth];
    level.take_next = false;
    if (reduce(openAt(depth), takenAt(depth), level.size, target)) {
      if (isEmpty(openAt(depth))) {
        std::copy(takenAt(depth).begin(), takenAt(depth).end(), best_.begin());
        target = level.size + 1;
      } else if (level.size + colours(openAt(depth), target - level.size) >= target) {
        if (depth + 1 == max_depth_) {
          result.exact = false;
        } else {
          level.vertex = mostConflicts(openAt(depth));
          level.take_next = true;
          std::copy(openAt(depth).begin(), openAt(depth).end(), openAt(depth + 1).begin());
          std::copy(takenAt(depth).begin(), takenAt(depth).end(), takenAt(depth + 1).begin());
          clearBit(openAt(depth + 1), level.vertex);
          levels_[depth + 1].size = level.size;
          ++depth;
          continue;
        }
      }
    }
    // Back to the nearest node whose second branch is open: it becomes that branch, in place.
    while (depth > 0 && !levels_[depth].take_next) {
      --depth;
    }
    Level& back = levels_[depth];
    if (!back.take_next) {
      return result;
    }
    setBit(takenAt(depth), back.vertex);
    clearBit(openAt(depth), back.vertex);
    remove(openAt(depth), conflicts(back.vertex));
    ++back.size;
    back.take_next = false;
  }
}

}  // namespace swiftlet
