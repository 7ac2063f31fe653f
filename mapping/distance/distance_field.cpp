#include "mapping/distance/distance_field.hpp"

#include <cmath>
#include <cstring>

namespace swiftlet {
namespace {

// Surface lies up to so far [cells] from the middles of the cells that hold it.
constexpr float kSpread = 1.5F;
constexpr int kSpreadCells = 2;  // whole ones
// The window moves once the vehicle is an eighth of it away from its middle.
constexpr int kSlack = 8;
// Unknown cells are looked for in cells of so many a side.
constexpr int kCoarse = 2;
// A query goes along the surface for so many cells at most; on logs it needs one or two.
constexpr int kMostDescents = 4;
constexpr int kStep = kDistanceStep;
constexpr int kFour = kStep / kCoarse;   // coarse cells along x side by side
constexpr std::uint32_t kTagShift = 29;  // of both words: one bit an axis

/// The surface point inside a cell, 7 bits an axis, +-0.5 cells from its middle, present or not; the
/// cell's space; the axes along which the cell has surface on both sides; the tag.
struct StateWord {
  static constexpr float kScale = 126;  // 63 at half a cell
  static constexpr std::uint32_t kPresent = 1U << 21U;
  static constexpr std::uint32_t kSpaceShift = 22;
  static constexpr std::uint32_t kSidesShift = 24;

  static std::uint32_t pack(Space space) { return static_cast<std::uint32_t>(space) << kSpaceShift; }
  static std::uint32_t pack(Space space, const SurfacePoint& point) {
    std::uint32_t word = pack(space) | kPresent;
    for (int i = 0; i < 3; ++i) {
      const float kept = std::clamp(point.offset[i], -kMostOffset, kMostOffset) * kScale;
      const auto bits = static_cast<std::uint32_t>(std::lround(kept) + 64);
      word |= bits << (7U * static_cast<std::uint32_t>(i));
      if (point.both_sides[static_cast<std::size_t>(i)])
        word |= 1U << (kSidesShift + static_cast<std::uint32_t>(i));
    }
    return word;
  }
  static Space space(std::uint32_t word) { return static_cast<Space>(word >> kSpaceShift & 3U); }
  static bool isUnknown(std::uint32_t word) { return space(word) == Space::kUnknown; }
  static bool holds(std::uint32_t word, std::uint32_t tag) {
    return (word & kPresent) != 0 && word >> kTagShift == tag >> kTagShift;
  }
  /// From a point to the surface of a cell whose middle is at `middle` from it.
  static float squaredTo(std::uint32_t word, const Eigen::Vector3f& middle) {
    float squared = 0;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const float offset = static_cast<float>(static_cast<int>(word >> (7U * i) & 127U) - 64) / kScale;
      const float to = middle[i];
      const bool both = (word >> (kSidesShift + i) & 1U) != 0;
      const float along = both ? std::abs(to) - std::abs(offset) : to + offset;
      squared += along * along;
    }
    return squared;
  }
};

/// Steps to the cell with the nearest surface, 7 bits an axis, biased by 64, or, where none is in reach, how
/// far there is none for sure [cells]; how far nothing is unknown [cells]; the tag.
struct NearestWord {
  static constexpr int kBias = 64;
  static constexpr std::uint32_t kHasSurface = 1U << 21U;
  static constexpr std::uint32_t kKnownShift = 22;

  static Eigen::Vector3i steps(std::uint32_t word) {
    return {static_cast<int>(word & 127U) - kBias, static_cast<int>(word >> 7U & 127U) - kBias,
            static_cast<int>(word >> 14U & 127U) - kBias};
  }
  static float atLeast(std::uint32_t word) { return static_cast<float>(word & 127U); }
  static int knownTo(std::uint32_t word) { return static_cast<int>(word >> kKnownShift & 127U); }
};

constexpr std::size_t kLanes = static_cast<std::size_t>(NearestSeeds::kColumns) * NearestSeeds::kLayers;
template <typename Value>
using Lanes = std::array<Value, kLanes>;

/// From words of NearestSeeds; nothing is known of surfaces from `edges` and `edge_y` cells on. `rest`,
/// `tag`: the other bits.
void toNearest(Lanes<std::uint32_t>& words, const Lanes<int>& edges, int edge_y,
               const Lanes<std::uint32_t>& rest, std::uint32_t tag) {
  for (std::size_t i = 0; i < kLanes; ++i) {
    const NearestSeeds::Word seed = words[i];
    const int within = std::min(edges[i], edge_y);
    const auto biased = [](int steps) { return static_cast<std::uint32_t>(steps + NearestWord::kBias); };
    const std::uint32_t found = biased(NearestSeeds::xOf(seed)) | biased(NearestSeeds::yOf(seed)) << 7U |
                                biased(NearestSeeds::zOf(seed)) << 14U | NearestWord::kHasSurface;
    const auto none = static_cast<std::uint32_t>(std::max(within - kSpreadCells, 0));
    words[i] = NearestSeeds::squaredOf(seed) <= within * within ? found : none;
    words[i] |= rest[i] | tag;
  }
}

int floorDiv(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }
int wrapped(int a, int b) {
  const int rest = a % b;
  return rest < 0 ? rest + b : rest;
}

// Origins are kept for readers in steps, 21 bits an axis.
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

Eigen::Vector3i unpackOrigin(std::uint64_t word) {
  Eigen::Vector3i origin;
  for (int i = 0; i < 3; ++i) {
    const std::uint64_t steps = word >> (21U * static_cast<unsigned>(i)) & kOriginMask;
    origin[i] = static_cast<int>(static_cast<std::int64_t>(steps) - kOriginBias) * kStep;
  }
  return origin;
}

DistanceLimits checked(DistanceLimits limits) {
  for (int i = 0; i < 3; ++i) limits.cells[i] = std::max(limits.cells[i] / kStep, 2) * kStep;
  limits.reach = std::clamp(limits.reach, 2, kMostReach);
  return limits;
}

/// Cells to the nearest one outside a line of `count`.
int edge(int at, int count) { return std::min(at + 1, count - at); }

Eigen::Vector3i cornerOf(int i) { return {i & 1, i >> 1 & 1, i >> 2 & 1}; }

/// Of eight bits whether one of each pair is set.
std::uint8_t pairs(std::uint8_t bits) {
  std::uint32_t result = 0;
  for (std::uint32_t i = 0; i < 4; ++i) result |= (bits >> (2 * i) & 3U) != 0 ? 1U << i : 0U;
  return static_cast<std::uint8_t>(result);
}

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
      unknown_(limits_.cells / kCoarse, limits_.reach / kCoarse + 1, 1),
      known_to_(state_.size() / (kCoarse * kCoarse * kCoarse)) {
  for (int i = 0; i < 3; ++i) origin_[i] = -floorDiv(limits_.cells[i] / 2, kStep) * kStep;
  clearSlab(0, origin_.x(), origin_.x() + limits_.cells.x());
  publishOrigin();
}

void DistanceField::publishOrigin() { shown_origin_.store(packOrigin(origin_), std::memory_order_release); }

std::size_t DistanceField::bytes() const {
  return state_.size() * 2 * sizeof(Word) + surface_bits_.size() + unknown_bits_.size() + known_to_.size() +
         surfaces_.bytes() + unknown_.bytes();
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

void DistanceField::setSpace(const Eigen::Vector3i& cell, Space space) {
  if (inside(cell)) put(slotOf(cell), cell.y(), tagOf(cell) | StateWord::pack(space));
}

void DistanceField::setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                              const std::array<Space, kDistanceStep>& space) {
  // The window begins and ends at multiples of kDistanceStep: a row lies in it whole, and in slots side by
  // side.
  if (!inside(first)) return;
  const std::size_t slot = slotOf(first);
  const std::uint32_t tag = tagOf(first);
  for (std::size_t i = 0; i < kStep; ++i) {
    if ((cells >> i & 1U) != 0) put(slot + i, first.y(), tag | StateWord::pack(space[i]));
  }
}

void DistanceField::setSurface(const Eigen::Vector3i& cell, Space space, const SurfacePoint& point) {
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
    // Who asks meanwhile finds words of another place, and takes them for unknown.
    origin_[axis] = to;
    publishOrigin();
    clearSlab(axis, to > from ? to + cells - steps : to, to > from ? to + cells : to + steps);
  }
  return origin_ != before;
}

/// The cells that entered, from `first` to before `last`, are unknown.
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
  // All lies elsewhere in the window now.
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
  const Eigen::Vector3i n = limits_.cells / kCoarse;
  for (int y = 0; y < n.y(); ++y) {
    std::uint8_t* const changed = &unknown_changed_[static_cast<std::size_t>(kCoarse * y)];
    if (changed[0] == 0 && changed[1] == 0) continue;
    changed[0] = changed[1] = 0;
    for (int z = 0; z < n.z(); ++z) {
      const auto row = unknown_.seeds(z);
      std::fill(row.begin(), row.end(), std::uint8_t{0});
      for (int block = 0; block < limits_.cells.x() / kStep; ++block) {
        std::uint8_t bits = 0;
        for (int i = 0; i < kCoarse * kCoarse; ++i) {
          const Eigen::Vector3i cell(kStep * block, kCoarse * y + i % kCoarse, kCoarse * z + i / kCoarse);
          bits |= unknown_bits_[slotOf(origin_ + cell) / kStep];
        }
        row[static_cast<std::size_t>(block / 2)] |= static_cast<std::uint8_t>(pairs(bits) << (block % 2 * 4));
      }
    }
    unknown_.transformPlane(y);
  }
  for (int x = 0; x < n.x(); x += kStep) {
    for (int z = 0; z < n.z(); z += NearestSeeds::kLayers) keepKnown(x, z);
  }
}

/// Of the coarse cells x to x + 7, z and z + 1, for every y.
void DistanceField::keepKnown(int x, int z) {
  const Eigen::Vector3i n = limits_.cells / kCoarse;
  const auto lines = unknown_.transformLines(x, z);
  for (int half = 0; half < 2 && x + half * kFour < n.x(); ++half) {
    for (int layer = 0; layer < NearestSeeds::kLayers; ++layer) {
      std::uint8_t* known = &known_to_[placeOfKnown(x + half * kFour, z + layer)];
      for (int y = 0; y < n.y(); ++y) {
        const int edge_yz = std::min(edge(y, n.y()), edge(z + layer, n.z()));
        for (int i = 0; i < kFour; ++i) {
          const auto word = lines[static_cast<std::size_t>(y)][static_cast<std::size_t>(layer)]
                                 [static_cast<std::size_t>(half * kFour + i)];
          // Outside the window nothing is known: as far as there are cells between.
          const int at_most = std::min(edge_yz, edge(x + half * kFour + i, n.x())) - 1;
          const float gap = std::sqrt(static_cast<float>(NearestSeeds::squaredOf(word)));
          const int known_to = std::min(static_cast<int>(gap * kCoarse), kCoarse * at_most);
          *known++ = static_cast<std::uint8_t>(std::min(known_to, limits_.reach));
        }
      }
    }
  }
}

std::size_t DistanceField::placeOfKnown(int x, int z) const {
  const Eigen::Vector3i n = limits_.cells / kCoarse;
  return static_cast<std::size_t>(((x / kFour * n.z()) + z) * n.y() * kFour);
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

/// What readers see of the cells x to x + 7, z and z + 1, for every y.
void DistanceField::writeLines(int x, int z) {
  const Eigen::Vector3i& n = limits_.cells;
  const auto lines = surfaces_.transformLines(x, z);
  const std::uint8_t* known = &known_to_[placeOfKnown(x / kCoarse, z / kCoarse)];
  // A surface outside the window may be nearer than what is farther than the window's edge.
  Lanes<int> edges;
  for (int i = 0; i < static_cast<int>(kLanes); ++i)
    edges[static_cast<std::size_t>(i)] =
        std::min({edge(x + i % kStep, n.x()), edge(z + i / kStep, n.z()), limits_.reach});
  const Eigen::Vector3i first = origin_ + Eigen::Vector3i(x, 0, z);
  std::size_t slot = slotOf(first);
  std::uint32_t tag = tagOf(first);
  Lanes<std::uint32_t> words, rest;
  for (int y = 0; y < n.y(); ++y) {
    if (y % kCoarse == 0) {
      for (std::size_t i = 0; i < kLanes; ++i)
        rest[i] = std::uint32_t{known[i % kStep / kCoarse]} << NearestWord::kKnownShift;
      known += kFour;
    }
    std::memcpy(words.data(), &lines[static_cast<std::size_t>(y)], sizeof(words));
    toNearest(words, edges, edge(y, n.y()), rest, tag);
    for (std::size_t i = 0; i < kLanes; ++i) nearest_[slot + i].store(words[i], std::memory_order_relaxed);
    slot += kLanes;
    if (wrapped(first.y() + y + 1, n.y()) != 0) continue;
    // Around the window's seam.
    slot -= static_cast<std::size_t>(n.y()) * kLanes;
    tag ^= 2U << kTagShift;
  }
}

/// A cell that holds surface, from the first corner of a query [cells].
struct DistanceField::Holder {
  Eigen::Vector3i cell;
  std::uint32_t state = 0;
  [[nodiscard]] float squaredTo(const Eigen::Vector3f& p) const {
    return StateWord::squaredTo(state, cell.cast<float>() - p);
  }
};

/// What a query asks of one of the eight cells around the point.
struct DistanceField::Corner {
  Space space = Space::kUnknown;
  std::uint32_t nearest = 0;  ///< NearestWord
  bool held = false;          ///< its nearest surface is still there
  Holder holder;
  /// No surface lies nearer to the cell's middle [cells].
  [[nodiscard]] float atLeast() const {
    if ((nearest & NearestWord::kHasSurface) == 0) return NearestWord::atLeast(nearest);
    return NearestWord::steps(nearest).cast<float>().norm() - kSpread;
  }
};

/// False where one is of another place: outside the window, or the window moves.
bool DistanceField::corners(const Eigen::Vector3i& first, std::array<Corner, 8>& out) const {
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i cell = first + cornerOf(i);
    const std::size_t slot = slotOf(cell);
    const std::uint32_t tag = tagOf(cell);
    const std::uint32_t state = state_[slot].load(std::memory_order_relaxed);
    Corner& corner = out[static_cast<std::size_t>(i)];
    corner.nearest = nearest_[slot].load(std::memory_order_relaxed);
    if (state >> kTagShift != tag >> kTagShift || corner.nearest >> kTagShift != tag >> kTagShift)
      return false;
    corner.space = StateWord::space(state);
    if ((corner.nearest & NearestWord::kHasSurface) == 0) continue;
    corner.holder.cell = cornerOf(i) + NearestWord::steps(corner.nearest);
    corner.held = findHolder(first, corner.holder);
  }
  return true;
}

bool DistanceField::findHolder(const Eigen::Vector3i& first, Holder& holder) const {
  const Eigen::Vector3i cell = first + holder.cell;
  holder.state = state_[slotOf(cell)].load(std::memory_order_relaxed);
  return StateWord::holds(holder.state, tagOf(cell));
}

/// The nearest cell need not hold the nearest point: from the nearest of those that the corners name from
/// neighbour to neighbour along the surface, as long as that leads nearer.
DistanceField::Holder DistanceField::descend(const Eigen::Vector3i& first, const Eigen::Vector3f& part,
                                             const std::array<Corner, 8>& corner) const {
  Holder best = corner[0].holder;
  float least = best.squaredTo(part);
  const auto take = [&](const Holder& holder) {
    const float squared = holder.squaredTo(part);
    if (squared >= least) return;
    least = squared;
    best = holder;
  };
  for (const Corner& one : corner) take(one.holder);
  for (int round = 0; round < kMostDescents; ++round) {
    const Eigen::Vector3i middle = best.cell;
    for (int i = 0; i < 27; ++i) {
      Holder beside{middle + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1), 0};
      if (findHolder(first, beside)) take(beside);
    }
    if (best.cell == middle) break;
  }
  return best;
}

DistanceSample DistanceField::query(const Eigen::Vector3d& p_map) const {
  DistanceSample out;
  out.up_to.ns = up_to_.load(std::memory_order_acquire);
  out.stale = out.up_to.ns < newest_.load(std::memory_order_relaxed);
  const Eigen::Vector3d at = p_map.array() / limits_.cell_size - 0.5;
  const Eigen::Vector3i origin = unpackOrigin(shown_origin_.load(std::memory_order_acquire));
  const Eigen::Array3d from = at.array() - origin.cast<double>().array();
  if (!((from >= 0).all() && (from < limits_.cells.cast<double>().array() - 1).all())) return out;
  const Eigen::Vector3i first = at.array().floor().cast<int>();
  const Eigen::Vector3d part = at - first.cast<double>();
  std::array<Corner, 8> corner;
  if (!corners(first, corner)) return out;
  const auto bit = [&](int axis) { return part[axis] < 0.5 ? 0 : 1 << axis; };
  const Corner& own = corner[static_cast<std::size_t>(bit(0) + bit(1) + bit(2))];
  out.space = own.space;
  if (out.space == Space::kUnknown) return out;
  out.known_to = limits_.cell_size * NearestWord::knownTo(own.nearest);
  const bool measured = std::all_of(corner.begin(), corner.end(), [](const Corner& one) { return one.held; });
  if (measured) {
    interpolate(corner, descend(first, part.cast<float>(), corner), part, out);
  } else {
    out.kind = DistanceKind::kAtLeast;
    for (int i = 0; i < 8; ++i) {
      const double there = static_cast<double>(corner[static_cast<std::size_t>(i)].atLeast());
      out.distance = std::max(out.distance, there - (cornerOf(i).cast<double>() - part).norm());
    }
    if (out.space == Space::kBehindSurface) out.distance = -out.distance;
  }
  out.distance *= limits_.cell_size;
  return out;
}

/// The distance between cells' middles is linear along each axis. In cells.
void DistanceField::interpolate(const std::array<Corner, 8>& corner, const Holder& near_point,
                                const Eigen::Vector3d& part, DistanceSample& out) {
  out.kind = DistanceKind::kDistance;
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3i bit = cornerOf(i);
    float squared = near_point.squaredTo(bit.cast<float>());
    for (const Corner& one : corner) squared = std::min(squared, one.holder.squaredTo(bit.cast<float>()));
    const Space space = corner[static_cast<std::size_t>(i)].space;
    // Between the point and an unknown cell there is no surface that is known.
    const bool behind = (space == Space::kUnknown ? out.space : space) == Space::kBehindSurface;
    const double distance = static_cast<double>(behind ? -std::sqrt(squared) : std::sqrt(squared));
    Eigen::Vector3d weight;
    for (int axis = 0; axis < 3; ++axis) weight[axis] = bit[axis] != 0 ? part[axis] : 1 - part[axis];
    out.distance += weight.prod() * distance;
    for (int axis = 0; axis < 3; ++axis) {
      const double others = weight[(axis + 1) % 3] * weight[(axis + 2) % 3];
      slope[axis] += (bit[axis] != 0 ? others : -others) * distance;
    }
  }
  if (slope.norm() > 0) out.gradient = slope.normalized();
}

}  // namespace swiftlet
