#include "mapping/distance/distance_field.hpp"

#include <algorithm>
#include <cstring>

#include "mapping/distance/distance_word.hpp"

namespace swiftlet {
namespace {

// The window moves when the vehicle is farther from its middle than 1 / kSlack of the window's size.
constexpr int kSlack = 8;
constexpr int kStep = kDistanceStep;

constexpr std::size_t kLanes = static_cast<std::size_t>(NearestSeeds::kColumns) * NearestSeeds::kLayers;
template <typename Value>
using Lanes = std::array<Value, kLanes>;

/// Converts words of NearestSeeds to words of NearestWord, in place. Surfaces farther than `edges` or
/// `edge_y` cells may be missing from the window. `rest`, `tag`: the other bits.
void toNearest(Lanes<std::uint32_t>& words, const Lanes<int>& edges, int edge_y,
               const Lanes<std::uint32_t>& rest, std::uint32_t tag) {
  for (std::size_t i = 0; i < kLanes; ++i) {
    const NearestSeeds::Word seed = words[i];
    const int within = std::min(edges[i], edge_y);
    const auto biased = [](int steps) { return static_cast<std::uint32_t>(steps + NearestWord::kBias); };
    const std::uint32_t found = biased(NearestSeeds::xOf(seed)) | biased(NearestSeeds::yOf(seed)) << 7U |
                                biased(NearestSeeds::zOf(seed)) << 14U | NearestWord::kHasSurface;
    const auto none = static_cast<std::uint32_t>(std::max(within - NearestWord::kSpreadCells, 0));
    words[i] = NearestSeeds::squaredOf(seed) <= within * within ? found : none;
    words[i] |= rest[i] | tag;
  }
}

int floorDiv(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }
int wrapped(int a, int b) {
  const int rest = a % b;
  return rest < 0 ? rest + b : rest;
}

// The origin that readers use is packed in units of kStep, 21 bits per axis.
constexpr std::uint64_t kOriginMask = (1ULL << 21U) - 1;
constexpr std::int64_t kOriginBias = 1 << 20;

std::uint64_t packOrigin(const Eigen::Vector3i& origin) {
  std::uint64_t word = 0;
  for (int i = 0; i < 3; ++i) {
    const std::int64_t steps = origin[i] / kStep + kOriginBias;
    word |= (static_cast<std::uint64_t>(steps) & kOriginMask) << (21U * static_cast<unsigned>(i));
  }
  return word;
}

DistanceLimits checked(DistanceLimits limits) {
  for (int i = 0; i < 3; ++i) limits.cells[i] = std::max(limits.cells[i] / kStep, 2) * kStep;
  limits.reach = std::clamp(limits.reach, 2, kMostReach);
  return limits;
}

/// Steps to the nearest cell outside a line of `count` cells.
int edge(int at, int count) { return std::min(at + 1, count - at); }

}  // namespace

DistanceField::DistanceField(const DistanceLimits& limits)
    : limits_(checked(limits)),
      state_(static_cast<std::size_t>(limits_.cells.prod())),
      nearest_(state_.size()),
      surface_bits_(state_.size() / kStep),
      unknown_bits_(surface_bits_.size()),
      surface_changed_(static_cast<std::size_t>(limits_.cells.y())),
      unknown_changed_(surface_changed_.size()),
      surfaces_(limits_.cells, limits_.reach),
      known_(limits_.cells, limits_.reach) {
  for (int i = 0; i < 3; ++i) origin_[i] = -floorDiv(limits_.cells[i] / 2, kStep) * kStep;
  clearSlab(0, origin_.x(), origin_.x() + limits_.cells.x());
  publishOrigin();
}

void DistanceField::publishOrigin() { shown_origin_.store(packOrigin(origin_), std::memory_order_release); }

Eigen::Vector3i DistanceField::shownOrigin() const {
  const std::uint64_t word = shown_origin_.load(std::memory_order_acquire);
  Eigen::Vector3i origin;
  for (int i = 0; i < 3; ++i) {
    const std::uint64_t steps = word >> (21U * static_cast<unsigned>(i)) & kOriginMask;
    origin[i] = static_cast<int>(static_cast<std::int64_t>(steps) - kOriginBias) * kStep;
  }
  return origin;
}

std::size_t DistanceField::bytes() const {
  return state_.size() * 2 * sizeof(Word) + surface_bits_.size() + unknown_bits_.size() + surfaces_.bytes() +
         known_.bytes();
}

Eigen::Vector3i DistanceField::cellOf(const Eigen::Vector3d& p_map) const {
  return (p_map / limits_.cell_size).array().floor().cast<int>();
}

Eigen::Vector3d DistanceField::centreOf(const Eigen::Vector3i& cell) const {
  return (cell.cast<double>().array() + 0.5) * limits_.cell_size;
}

bool DistanceField::inside(const Eigen::Vector3i& cell) const {
  const Eigen::Vector3i from = cell - origin_;
  return (from.array() >= 0).all() && (from.array() < limits_.cells.array()).all();
}

std::size_t DistanceField::slotOf(const Eigen::Vector3i& cell) const {
  const Eigen::Vector3i& n = limits_.cells;
  const int x = wrapped(cell.x(), n.x()), y = wrapped(cell.y(), n.y()), z = wrapped(cell.z(), n.z());
  const int line = x / kStep * (n.z() / NearestSeeds::kLayers) + z / NearestSeeds::kLayers;
  return static_cast<std::size_t>(line * n.y() + y) * kLanes +
         static_cast<std::size_t>(z % NearestSeeds::kLayers * kStep + x % kStep);
}

std::uint32_t DistanceField::tagOf(const Eigen::Vector3i& cell) const {
  std::uint32_t tag = 0;
  for (int i = 0; i < 3; ++i) {
    const auto turns = static_cast<std::uint32_t>(floorDiv(cell[i], limits_.cells[i]));
    tag |= (turns & 1U) << static_cast<unsigned>(i);
  }
  return tag << kTagShift;
}

bool DistanceField::holdsSurface(const Eigen::Vector3i& cell) const {
  return inside(cell) && (state_[slotOf(cell)].load(std::memory_order_relaxed) & StateWord::kPresent) != 0;
}

void DistanceField::put(std::size_t slot, int y, std::uint32_t word) {
  const std::uint32_t before = state_[slot].load(std::memory_order_relaxed);
  if (word == before) return;
  state_[slot].store(word, std::memory_order_relaxed);
  const auto bit = static_cast<std::uint8_t>(1U << slot % kStep);
  const auto at = static_cast<std::size_t>(y - origin_.y());
  const auto flip = [&](bool flipped, std::uint8_t& bits, std::uint8_t& changed) {
    if (!flipped) return;
    bits ^= bit;
    changed = 1;
    changed_ = true;
  };
  flip(((word ^ before) & StateWord::kPresent) != 0, surface_bits_[slot / kStep], surface_changed_[at]);
  flip(StateWord::isUnknown(word) != StateWord::isUnknown(before), unknown_bits_[slot / kStep],
       unknown_changed_[at]);
}

void DistanceField::setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                              const std::array<Space, kDistanceStep>& space) {
  // The window begins and ends at multiples of kDistanceStep, so it contains the whole row, in adjacent
  // slots.
  if (!inside(first)) return;
  const std::size_t slot = slotOf(first);
  const std::uint32_t tag = tagOf(first);
  for (std::size_t i = 0; i < kStep; ++i) {
    if ((cells >> i & 1U) != 0) put(slot + i, first.y(), tag | StateWord::pack(space[i]));
  }
}

void DistanceField::setSurface(const Eigen::Vector3i& cell, Space space, const CellSurface& point) {
  if (inside(cell)) put(slotOf(cell), cell.y(), tagOf(cell) | StateWord::pack(space, point));
}

bool DistanceField::follow(const Eigen::Vector3d& p_map) {
  const Eigen::Vector3i before = origin_;
  const Eigen::Vector3i cell = cellOf(p_map);
  for (int axis = 0; axis < 3; ++axis) {
    const int cells = limits_.cells[axis];
    const int wanted = cell[axis] - cells / 2;
    if (std::abs(wanted - origin_[axis]) <= std::max(cells / kSlack, kStep)) continue;
    const int from = origin_[axis];
    const int to = floorDiv(wanted, kStep) * kStep;
    const int steps = std::min(std::abs(to - from), cells);
    origin_[axis] = to;
    clearSlab(axis, to > from ? to + cells - steps : to, to > from ? to + cells : to + steps);
    // Until then, queries use the old origin and find the cells that left unknown, by their tags.
    publishOrigin();
  }
  return origin_ != before;
}

/// Sets the cells that entered the window, [first, last) along `axis`, to unknown.
void DistanceField::clearSlab(int axis, int first, int last) {
  Eigen::Vector3i low = origin_;
  Eigen::Vector3i high = origin_ + limits_.cells;
  low[axis] = first;
  high[axis] = last;
  for (int x = low.x(); x < high.x(); x += kStep) {
    for (int z = low.z(); z < high.z(); ++z) {
      for (int y = low.y(); y < high.y(); ++y) {
        const std::size_t slot = slotOf({x, y, z});
        const std::uint32_t tag = tagOf({x, y, z});
        for (std::size_t i = 0; i < kStep; ++i) {
          nearest_[slot + i].store(tag, std::memory_order_relaxed);
          state_[slot + i].store(tag, std::memory_order_relaxed);
        }
        surface_bits_[slot / kStep] = 0;
        unknown_bits_[slot / kStep] = 0xFF;
      }
    }
  }
  // The contents have moved relative to the window: transform all planes again.
  std::fill(surface_changed_.begin(), surface_changed_.end(), std::uint8_t{1});
  std::fill(unknown_changed_.begin(), unknown_changed_.end(), std::uint8_t{1});
  changed_ = true;
}

void DistanceField::update(Stamp up_to) {
  if (changed_) {
    findUnknown();
    findSurfaces();
    changed_ = false;
  }
  up_to_.store(up_to.ns, std::memory_order_release);
}

void DistanceField::findUnknown() {
  constexpr int kSide = KnownRange::kSide;
  for (int y = 0; y < limits_.cells.y() / kSide; ++y) {
    std::uint8_t* const changed = &unknown_changed_[static_cast<std::size_t>(kSide * y)];
    if (std::all_of(changed, changed + kSide, [](std::uint8_t flag) { return flag == 0; })) continue;
    std::fill_n(changed, kSide, std::uint8_t{0});
    known_.setPlane(y, [&](int block, int z) {
      std::uint8_t bits = 0;
      for (int i = 0; i < kSide * kSide; ++i) {
        const Eigen::Vector3i cell(kStep * block, kSide * y + i % kSide, kSide * z + i / kSide);
        bits |= unknown_bits_[slotOf(origin_ + cell) / kStep];
      }
      return bits;
    });
  }
  known_.update();
}

void DistanceField::findSurfaces() {
  const Eigen::Vector3i& n = limits_.cells;
  for (int y = 0; y < n.y(); ++y) {
    std::uint8_t& changed = surface_changed_[static_cast<std::size_t>(y)];
    if (changed == 0) continue;
    changed = 0;
    for (int z = 0; z < n.z(); ++z) {
      const auto row = surfaces_.seeds(z);
      for (int block = 0; block < n.x() / kStep; ++block) {
        const std::size_t slot = slotOf(origin_ + Eigen::Vector3i(kStep * block, y, z));
        row[static_cast<std::size_t>(block)] = surface_bits_[slot / kStep];
      }
    }
    surfaces_.transformPlane(y);
  }
  for (int x = 0; x < n.x(); x += kStep) {
    for (int z = 0; z < n.z(); z += NearestSeeds::kLayers) writeLines(x, z);
  }
}

/// Writes the words that readers use, for the cells x to x + 7, z and z + 1 and every y.
void DistanceField::writeLines(int x, int z) {
  const Eigen::Vector3i& n = limits_.cells;
  const auto lines = surfaces_.transformLines(x, z);
  const std::uint8_t* known = known_.line(x, z);
  // Surface beyond the window's edge is not seen, so distances larger than that to the edge are not certain.
  Lanes<int> edges;
  for (int i = 0; i < static_cast<int>(kLanes); ++i)
    edges[static_cast<std::size_t>(i)] =
        std::min({edge(x + i % kStep, n.x()), edge(z + i / kStep, n.z()), limits_.reach});
  const Eigen::Vector3i first = origin_ + Eigen::Vector3i(x, 0, z);
  std::size_t slot = slotOf(first);
  std::uint32_t tag = tagOf(first);
  Lanes<std::uint32_t> words, rest;
  for (int y = 0; y < n.y(); ++y) {
    if (y % KnownRange::kSide == 0) {
      for (std::size_t i = 0; i < kLanes; ++i)
        rest[i] = std::uint32_t{known[i % kStep / KnownRange::kSide]} << NearestWord::kKnownShift;
      known += KnownRange::kAcross;
    }
    std::memcpy(words.data(), &lines[static_cast<std::size_t>(y)], sizeof(words));
    toNearest(words, edges, edge(y, n.y()), rest, tag);
    for (std::size_t i = 0; i < kLanes; ++i) nearest_[slot + i].store(words[i], std::memory_order_relaxed);
    slot += kLanes;
    if (wrapped(first.y() + y + 1, n.y()) != 0) continue;
    // Slots wrap around here.
    slot -= static_cast<std::size_t>(n.y()) * kLanes;
    tag ^= 2U << kTagShift;
  }
}

}  // namespace swiftlet
