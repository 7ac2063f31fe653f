#include "mapping/distance/nearest_seeds.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace swiftlet {
namespace {

// Number of steps taken at a time.
constexpr int kStride = 4;
constexpr int kNoSeed = -(1 << 20);

using Columns = NearestSeeds::Columns;
using Block = NearestSeeds::Block;

NearestSeeds::Word largest(const Block& words) {
  Columns all = words[0];
  for (std::size_t i = 1; i < NearestSeeds::kLayers; ++i) {
    for (std::size_t k = 0; k < NearestSeeds::kColumns; ++k) all[k] = std::max(all[k], words[i][k]);
  }
  for (std::size_t half = NearestSeeds::kColumns / 2; half > 0; half /= 2) {
    for (std::size_t k = 0; k < half; ++k) all[k] = std::max(all[k], all[k + half]);
  }
  return all[0];
}

bool anySeed(const Block& words) {
  for (const Columns& layer : words) {
    for (std::size_t i = 0; i < NearestSeeds::kColumns; ++i) {
      if (layer[i] < NearestSeeds::kNever >> 1U) return true;
    }
  }
  return false;
}

void takeLess(Block& best, const Block& from, NearestSeeds::Word step) {
  for (std::size_t i = 0; i < NearestSeeds::kLayers; ++i) {
    for (std::size_t k = 0; k < NearestSeeds::kColumns; ++k)
      best[i][k] = std::min(best[i][k], from[i][k] + step);
  }
}

Block allNever() {
  Block words;
  for (auto& word : words) word.fill(NearestSeeds::kNever);
  return words;
}

}  // namespace

NearestSeeds::NearestSeeds(const Eigen::Vector3i& cells, int reach, int gap)
    : cells_(cells),
      reach_(std::clamp(reach, 1, kMostReach)),
      gap_(gap),
      margin_(reach_ + kStride),
      blocks_((cells.x() + kColumns - 1) / kColumns),
      seeds_(static_cast<std::size_t>(blocks_ * cells.z())),
      row_(static_cast<std::size_t>(blocks_ * kColumns)),
      kept_(placeOf(cells.y(), 0), allNever()[0]) {
  for (int i = 0; i < reach_ + kStride; ++i) {
    const Word square = i <= reach_ ? squareOf(i) << kSquareShift : kNever >> 1U;
    const Word along = static_cast<Word>(i) << kZShift;
    in_z_.forward.push_back(square + along);
    in_z_.backward.push_back(square - along);
    in_y_.forward.push_back(square);
    in_y_.backward.push_back(square | 1U << kBeforeBit);
  }
  for (int i = 1; i <= reach_; ++i) furthest_.resize(squareOf(i), static_cast<std::uint8_t>(i));
  furthest_.push_back(static_cast<std::uint8_t>(reach_));
  const auto longest = static_cast<int>(row_.size());
  for (int i = 0; i <= longest; ++i) {
    const Word rest = squareOf(i) << kSquareShift | static_cast<Word>(kBias) << kZShift;
    after_seed_.push_back(i <= reach_ ? rest | static_cast<Word>(kBias - i) : kNever);
    before_seed_.push_back(i <= reach_ ? rest | static_cast<Word>(kBias + i) : kNever);
  }
  std::reverse(before_seed_.begin(), before_seed_.end());
  const auto longest_line = static_cast<std::size_t>(std::max(cells_.y(), cells_.z()));
  out_.resize(longest_line);
  line_.resize(longest_line + static_cast<std::size_t>(2 * margin_));
}

std::size_t NearestSeeds::bytes() const {
  return kept_.size() * sizeof(Columns) + (line_.size() + out_.size()) * sizeof(Block);
}

NearestSeeds::Word NearestSeeds::squareOf(int steps) const {
  const int between = std::max(steps - gap_, 0);
  return static_cast<Word>(between * between);
}

std::span<std::uint8_t> NearestSeeds::seeds(int z) {
  return {&seeds_[static_cast<std::size_t>(z * blocks_)], static_cast<std::size_t>(blocks_)};
}

void NearestSeeds::transformRow(std::span<const std::uint8_t> seeds) {
  int before = kNoSeed;
  for (std::size_t byte = 0; byte < seeds.size(); ++byte) {
    for (unsigned rest = seeds[byte]; rest != 0; rest &= rest - 1) {
      const int seed = static_cast<int>(byte) * kColumns + std::countr_zero(rest);
      fillBetween(before, seed);
      before = seed;
    }
  }
  fillBetween(before, static_cast<int>(row_.size()) - kNoSeed);
}

/// Fills the row from the seed at `before` to the one at `after`; each cell refers to the nearer of the two.
void NearestSeeds::fillBetween(int before, int after) {
  const int count = static_cast<int>(row_.size());
  const int first = std::max(before, 0);
  const int last = std::min(after, count);
  if (before < 0 && after >= count) {
    std::fill(row_.begin(), row_.end(), kNever);
    return;
  }
  const int middle = std::clamp((before + after + 2) / 2, first, last);
  if (before >= 0) std::copy_n(after_seed_.begin(), middle - first, row_.begin() + first);
  if (after < count)
    std::copy_n(before_seed_.end() - 1 - (after - middle), last - middle, row_.begin() + middle);
}

/// Transforms `line_` into `out_`.
void NearestSeeds::alongLine(int count, const Steps& steps) {
  // Beyond the line's ends there are no seeds.
  Block* const line = &line_[static_cast<std::size_t>(margin_)];
  std::fill_n(line - margin_, margin_, allNever());
  std::fill_n(line + count, margin_, allNever());
  int most = reach_;
  for (int i = 0; i < count; ++i) {
    const Block* const own = line + i;
    Block best = own[0];
    for (int first = 1; first <= most; first += kStride) {
      for (int step = first; step < first + kStride; ++step) {
        takeLess(best, own[step], steps.forward[static_cast<std::size_t>(step)]);
        takeLess(best, own[-step], steps.backward[static_cast<std::size_t>(step)]);
      }
    }
    out_[static_cast<std::size_t>(i)] = best;
    // From one cell to the next the distance grows by at most one.
    most = furthest_[std::min(static_cast<std::size_t>(squaredOf(largest(best))), furthest_.size() - 1)];
  }
}

void NearestSeeds::transformPlane(int y) {
  const auto layers = static_cast<std::size_t>(cells_.z());
  const auto blocks = static_cast<std::size_t>(blocks_);
  Columns* const kept = &kept_[placeOf(y, 0)];
  if (std::all_of(seeds_.begin(), seeds_.end(), [](std::uint8_t byte) { return byte == 0; })) {
    std::fill_n(kept, blocks * layers, allNever()[0]);
    return;
  }
  for (std::size_t z = 0; z < layers; ++z) {
    transformRow(seeds(static_cast<int>(z)));
    for (std::size_t block = 0; block < blocks; ++block)
      std::memcpy(&kept[block * layers + z], &row_[block * kColumns], sizeof(Columns));
  }
  // Two blocks of columns at a time, in the lanes that transformLines() uses for two layers.
  for (std::size_t first = 0; first < blocks; first += kLayers) {
    const std::size_t count = std::min<std::size_t>(kLayers, blocks - first);
    Block* const line = &line_[static_cast<std::size_t>(margin_)];
    for (std::size_t z = 0; z < layers; ++z) {
      for (std::size_t i = 0; i < kLayers; ++i)
        line[z][i] = kept[(first + std::min(i, count - 1)) * layers + z];
    }
    alongLine(cells_.z(), in_z_);
    for (std::size_t z = 0; z < layers; ++z) {
      for (std::size_t i = 0; i < count; ++i) kept[(first + i) * layers + z] = out_[z][i];
    }
  }
}

std::span<const NearestSeeds::Block> NearestSeeds::transformLines(int x, int z) {
  const auto count = static_cast<std::size_t>(cells_.y());
  const Columns* from = &kept_[placeOf(0, x / kColumns) + static_cast<std::size_t>(z)];
  bool any = false;
  for (std::size_t y = 0; y < count; ++y, from += placeOf(1, 0)) {
    Block& block = line_[y + static_cast<std::size_t>(margin_)];
    std::memcpy(&block, from, sizeof(Block));
    any = any || anySeed(block);
  }
  if (any) {
    alongLine(cells_.y(), in_y_);
  } else {
    std::fill(out_.begin(), out_.end(), allNever());
  }
  return {out_.data(), count};
}

}  // namespace swiftlet
